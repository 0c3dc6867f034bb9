//! The one time-out of readings: whatever a pack is read from, without a valid reading for too long its read fails.

use crate::time::Instant;

/// For how long a pack has had no valid reading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Silence {
    timeout_us: u64,
    /// When the latest reading was received, valid or not.
    heard_at: Instant,
    /// When the latest valid reading was received, or the time-out began.
    valid_at: Instant,
}

impl Silence {
    /// Nothing was received yet.
    pub const fn new(timeout_us: u64) -> Self {
        Self {
            timeout_us,
            heard_at: Instant::EPOCH,
            valid_at: Instant::EPOCH,
        }
    }

    /// The first tick: the time-out begins.
    pub fn start(&mut self, now: Instant) {
        self.valid_at = now;
    }

    /// A reading was received at `at`.
    pub fn hear(&mut self, at: Instant) {
        self.heard_at = self.heard_at.max(at);
    }

    /// The latest reading was valid.
    pub fn confirm(&mut self) {
        self.valid_at = self.valid_at.max(self.heard_at);
    }

    /// Whether a reading is overdue, in a tick without one.
    pub fn is_overdue(&self, now: Instant) -> bool {
        now.us_since(self.valid_at) >= self.timeout_us
    }
}
