//! Boards that begin alike are emulated once, and copied.

use std::sync::{Mutex, PoisonError};

use emulator::Firmware;

use crate::bench::Bench;

/// How many are kept: those that most tests begin with, at 3 MB each.
const KEPT: usize = 20;

/// What decides how a bench begins, to the byte and the cycle.
#[derive(Clone, PartialEq)]
pub enum Start {
    /// A second after power-up.
    PowerUp {
        code: u16,
        seed: u64,
        firmware: Firmware,
    },
    /// With these parameters, after the restart with which they are in effect.
    Configured(u16, Vec<(String, f32)>),
    /// A Pico W whose network is up and empty.
    AccessPoint(u16),
}

/// The one that was asked for last is the last.
static KNOWN: Mutex<Vec<(Start, Bench)>> = Mutex::new(Vec::new());

impl Start {
    /// A bench that has begun so. Tests that begin so at the same time do not wait for each other.
    pub fn shared(self, begin: impl FnOnce() -> Bench) -> Bench {
        let known = with_known(|known| {
            let place = known.iter().position(|(start, _)| *start == self)?;
            known[place..].rotate_left(1);
            known.last().map(|(_, bench)| bench.clone())
        });
        known.unwrap_or_else(|| {
            let bench = begin();
            self.keep(bench.clone());
            bench
        })
    }

    fn keep(self, bench: Bench) {
        with_known(|known| {
            known.retain(|(start, _)| *start != self);
            if known.len() == KEPT {
                known.remove(0);
            }
            known.push((self, bench));
        });
    }
}

fn with_known<T>(act: impl FnOnce(&mut Vec<(Start, Bench)>) -> T) -> T {
    act(&mut KNOWN.lock().unwrap_or_else(PoisonError::into_inner))
}
