//! The flash chip on the board: a W25Q16JV of 2 MB.
//!
//! Modelled: what sector erase, 64 KB block erase and page program do to the bits and how long they
//! take, sectors that are worn out, and what a power cut leaves. The contents outlast every reset
//! and every power cycle. Not modelled: bits that read differently from one time to the next after
//! a torn operation, wear by itself (erases are counted), write protection, suspend, sleep.

mod controls;
mod cut;
#[cfg(test)]
pub(super) mod fixture;
mod job;
#[cfg(test)]
mod job_tests;
mod make;
mod operation;
#[cfg(test)]
mod power_tests;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::clock::{Cycle, NEVER, micros};
use super::random::Random;
pub use cut::FlashCut;
pub use job::{Job, Step, transfer_cycles};
pub use make::{FlashMake, SerialChip, Status2Write, StatusWrite};
use operation::Command;
pub use operation::{FlashOperation, FlashOperationKind, FlashTiming};
use operation::{PAGE_SIZE, SECTOR_SIZE};

#[derive(Clone)]
pub struct FlashChip {
    /// Shared with the copies of the board until one of them changes it.
    bytes: Arc<Vec<u8>>,
    timing: FlashTiming,
    running: Option<Running>,
    operations: Vec<FlashOperation>,
    erase_counts: BTreeMap<u32, u64>,
    worn_sectors: BTreeSet<u32>,
    armed: Option<ArmedCut>,
    power_fails: bool,
    random: Random,
}

/// The command the chip is busy with.
#[derive(Clone)]
struct Running {
    command: Command,
    start: Cycle,
    end: Cycle,
    /// The power fails at the end.
    cut: Option<FlashCut>,
}

#[derive(Clone)]
struct ArmedCut {
    /// How many operations begin before the one that is cut.
    operations_before: u64,
    cut: FlashCut,
}

impl FlashChip {
    pub fn new(bytes: impl Into<Arc<Vec<u8>>>, seed: u64) -> Self {
        Self {
            bytes: bytes.into(),
            timing: FlashTiming::TYPICAL,
            running: None,
            operations: Vec::new(),
            erase_counts: BTreeMap::new(),
            worn_sectors: BTreeSet::new(),
            armed: None,
            power_fails: false,
            random: Random::new(seed),
        }
    }

    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub fn is_busy(&self) -> bool {
        self.running.is_some()
    }

    /// When [`Self::advance`] is needed next.
    pub fn next_event(&self) -> Cycle {
        self.running.as_ref().map_or(NEVER, |running| running.end)
    }

    /// Begin to carry out a command.
    pub fn begin(&mut self, command: Command, now: Cycle) {
        assert!(
            !self.is_busy(),
            "the flash chip takes no command while it is busy"
        );
        let cut = self.next_cut();
        let mut duration = self.timing.of(&command);
        if let Some(cut) = cut {
            duration = (duration as f64 * cut.share_of_time(&mut self.random)) as Cycle;
        }
        self.running = Some(Running {
            command,
            start: now,
            end: now + duration,
            cut,
        });
    }

    fn next_cut(&mut self) -> Option<FlashCut> {
        let armed = self.armed.as_mut()?;
        if let Some(left) = armed.operations_before.checked_sub(1) {
            armed.operations_before = left;
            return None;
        }
        self.armed.take().map(|armed| armed.cut)
    }

    /// Finish what is due; returns whether the contents may have changed.
    pub fn advance(&mut self, now: Cycle) -> bool {
        let Some(running) = self.running.take_if(|running| running.end <= now) else {
            return false;
        };
        self.power_fails |= running.cut.is_some();
        let end = running.end;
        self.finish(&running, end, running.cut);
        true
    }

    /// Whether an armed cut has come.
    pub fn take_power_failure(&mut self) -> bool {
        std::mem::take(&mut self.power_fails)
    }

    /// The power fails now, for another reason than an armed cut. What is under way is torn.
    pub fn lose_power(&mut self, now: Cycle) {
        if let Some(running) = self.running.take() {
            let cut = FlashCut::torn(&mut self.random);
            self.finish(&running, now, Some(cut));
        }
    }

    fn finish(&mut self, running: &Running, end: Cycle, cut: Option<FlashCut>) {
        let range = running.command.range();
        let place = range.start as usize..range.end as usize;
        let before = &self.bytes[place.clone()];
        let mut after = match cut {
            Some(cut) => cut.remains(&running.command, before, &mut self.random),
            None => running.command.result(before),
        };
        self.keep_worn_sectors(range.start, &mut after);
        Arc::make_mut(&mut self.bytes)[place].copy_from_slice(&after);
        if cut != Some(FlashCut::Before) {
            self.count_erases(&running.command);
        }
        self.operations.push(FlashOperation {
            time_us: micros(running.start),
            duration_us: micros(end - running.start),
            kind: running.command.kind(),
            offset: range.start,
            length: range.len() as u32,
            cut,
        });
    }

    /// Put back what worn sectors hold: their bits do not move any more.
    fn keep_worn_sectors(&self, offset: u32, after: &mut [u8]) {
        for (index, byte) in after.iter_mut().enumerate() {
            let address = offset + index as u32;
            if self.worn_sectors.contains(&sector_of(address)) {
                *byte = self.bytes[address as usize];
            }
        }
    }

    fn count_erases(&mut self, command: &Command) {
        if command.kind() == FlashOperationKind::PageProgram {
            return;
        }
        for sector in command.range().step_by(SECTOR_SIZE as usize) {
            *self.erase_counts.entry(sector).or_default() += 1;
        }
    }
}

/// Where the sector of an address begins.
fn sector_of(offset: u32) -> u32 {
    offset - offset % SECTOR_SIZE
}
