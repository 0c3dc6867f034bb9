//! Pauses in what is received.

use crate::time::Instant;

/// Notices pauses of more than `MAX_US` microseconds, which end a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gaps<const MAX_US: u64> {
    last_received: Instant,
}

impl<const MAX_US: u64> Gaps<MAX_US> {
    /// Nothing was received yet.
    pub fn new() -> Self {
        Self {
            last_received: Instant::EPOCH,
        }
    }

    /// Whether the bytes that were received at `now` come after such a pause.
    pub fn precede(&mut self, now: Instant) -> bool {
        let is_gap = now.us_since(self.last_received) > MAX_US;
        self.last_received = now;
        is_gap
    }
}
