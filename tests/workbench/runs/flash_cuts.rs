//! Power is cut in flash operations of one board's run: each time in a copy of the board from shortly before.

use std::iter::Peekable;

use crate::bench::Bench;
use emulator::FlashCut;

/// A board that keeps its power, and the operations in which copies of it lose theirs.
pub struct Leader<I: Iterator<Item = u64>> {
    pub bench: Bench,
    cut: FlashCut,
    /// The next one to begin is 1. They ascend.
    operations: Peekable<I>,
    /// Those of the board that are not counted.
    earlier: u64,
    /// Copies in whose operation the power is going to be cut.
    under_way: Vec<(u64, Bench)>,
}

impl<I: Iterator<Item = u64>> Leader<I> {
    pub fn new(bench: Bench, cut: FlashCut, operations: I) -> Self {
        let operations = operations.peekable();
        let earlier = begun(&bench);
        Self {
            bench,
            cut,
            operations,
            earlier,
            under_way: Vec::new(),
        }
    }

    /// Operations that have begun so far.
    pub fn begun(&self) -> u64 {
        begun(&self.bench) - self.earlier
    }

    /// Takes a step with the board, and with a copy for each operation that begins in it and is to be cut. `after_cut` gets the
    /// copies that lost their power in this step, and the numbers of their operations.
    pub fn step(&mut self, step: impl Fn(&mut Bench), mut after_cut: impl FnMut(Bench, u64)) {
        let before = self.bench.clone();
        let begun_before = self.begun();
        step(&mut self.bench);
        let begun = self.begun();
        let mut copies = std::mem::take(&mut self.under_way);
        while let Some(operation) = self.operations.next_if(|operation| *operation <= begun) {
            let mut copy = before.clone();
            copy.cut_power_at_flash_operation(operation - begun_before, self.cut);
            copies.push((operation, copy));
        }
        for (operation, mut copy) in copies {
            step(&mut copy);
            if copy.is_powered() {
                self.under_way.push((operation, copy));
            } else {
                after_cut(copy, operation);
            }
        }
    }
}

/// Those that are over, and the one that is not.
fn begun(bench: &Bench) -> u64 {
    bench.flash_operations().len() as u64 + u64::from(bench.flash_is_busy())
}
