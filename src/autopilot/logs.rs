//! Logs: what the flash has to do, and what of it is downloaded.

use super::autopilot::Autopilot;
use super::recording::LogStep;
use crate::recorder::{Erasure, FlashOutcome, Piece, Ring};
use crate::time::Instant;

impl Autopilot {
    /// The logs in flash were looked for. Nothing is recorded before.
    pub fn logs_found(&mut self, ring: Ring) {
        self.recording.found(ring);
    }

    /// What the flash has to do next for the log at `now`, if anything.
    pub fn next_log_step(&mut self, now: Instant) -> Option<LogStep> {
        let may_erase = self.may_erase();
        self.recording.next_step(now, &self.parameters, may_erase)
    }

    /// The outcome of programming a page.
    pub fn log_written(&mut self, outcome: FlashOutcome, now: Instant) {
        self.recording.written(outcome, now);
    }

    /// The outcome of an erase.
    pub fn log_erased(&mut self, erasure: Erasure, outcome: FlashOutcome) {
        self.recording.erased(erasure, outcome);
    }

    /// Where the bytes of a log from `offset` on are in flash.
    pub fn locate_log(&self, number: u16, offset: u32) -> Option<Piece> {
        self.recording.locate(number, offset)
    }
}
