//! The vehicle's own time for signatures.

use super::Timestamp;
use crate::time::Instant;

pub(super) const US_PER_TICK: u64 = 10;

/// A clock that never goes back and follows the latest sender.
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

    /// What it shows at `now`.
    pub fn time_at(&self, now: Instant) -> Timestamp {
        self.at_boot
            .later(now.as_micros() / US_PER_TICK)
            .max(self.last_given)
    }

    /// Goes on from `seen` if that is ahead.
    pub fn follow(&mut self, seen: Timestamp, now: Instant) {
        let ahead = seen.ticks().saturating_sub(self.time_at(now).ticks());
        self.at_boot = self.at_boot.later(ahead);
    }

    /// The time for the next frame, later than that of every frame before.
    pub fn next(&mut self, now: Instant) -> Timestamp {
        self.last_given = self.time_at(now).max(self.last_given.later(1));
        self.last_given
    }
}
