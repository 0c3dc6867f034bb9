//! The vehicle's own time for signatures.

use super::Timestamp;

const US_PER_TICK: u64 = 10;

/// A clock that never goes back and follows whoever is ahead.
#[derive(Clone, Debug)]
pub(super) struct SigningClock {
    at_boot: Timestamp,
    /// No two frames have the same.
    last_given: Timestamp,
}

impl SigningClock {
    /// A clock that shows `at_boot` when the board starts.
    pub fn starting_at(at_boot: Timestamp) -> Self {
        Self {
            at_boot,
            last_given: at_boot,
        }
    }

    /// What it shows.
    pub fn now(&self, now_us: u64) -> Timestamp {
        self.at_boot.later(now_us / US_PER_TICK).max(self.last_given)
    }

    /// Goes on from `seen` if that is ahead.
    pub fn follow(&mut self, seen: Timestamp, now_us: u64) {
        let ahead = seen.ticks().saturating_sub(self.now(now_us).ticks());
        self.at_boot = self.at_boot.later(ahead);
    }

    /// The time for the next frame, later than that of every frame before.
    pub fn next(&mut self, now_us: u64) -> Timestamp {
        self.last_given = self.now(now_us).max(self.last_given.later(1));
        self.last_given
    }
}
