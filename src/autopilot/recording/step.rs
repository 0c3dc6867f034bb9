//! What the flash has to do next.

use heapless::Vec;

use super::{Chunk, FLUSH_INTERVAL_US, LogFailure, MOST_FAILED_ERASES, PAGE_BYTES, Recording, State, is_on};
use crate::log::warn;
use crate::parameter::Parameters;
use crate::recorder::{AppendError, Erasure, MAX_SECTORS, Outcome};
use crate::storage::Erase;
use crate::time::Instant;

/// Half of the ring is kept erased for the next drive, so the last drive, which was no longer, is never erased for it.
const ERASED_AHEAD: u32 = MAX_SECTORS / 2;

/// What the flash has to do next for the log. Each has its report: [`Autopilot::log_written`](super::super::Autopilot::log_written),
/// [`Autopilot::log_erased`](super::super::Autopilot::log_erased).
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one at a time, and no heap")]
pub enum LogStep {
    /// Program these bytes, which are blank.
    Program {
        /// Where, as offset from the start of the flash.
        address: u32,
        /// What; within one page.
        bytes: Vec<u8, PAGE_BYTES>,
    },
    /// Erase a sector and program its mark, if the rover is still disarmed then.
    Erase(Erasure),
}

impl Recording {
    /// What the flash has to do next at `now`, if anything.
    pub fn next_step(&mut self, now: Instant, parameters: &Parameters, may_erase: Erase) -> Option<LogStep> {
        self.fill_chunk(now, parameters);
        if self.is_write_due(now) {
            return self.next_program();
        }
        if self.state == State::Closing && self.chunk.is_empty() {
            self.close();
        }
        match may_erase {
            Erase::Allowed if is_on(parameters) && self.failed_erases < MOST_FAILED_ERASES => {
                let ring = self.ring.as_mut()?;
                let target = ring.free_sectors().max(ERASED_AHEAD);
                ring.next_erase(target).map(LogStep::Erase)
            }
            _ => None,
        }
    }

    /// Takes as much out of the stream as a page holds, once there is so much, or it has to be written.
    fn fill_chunk(&mut self, now: Instant, parameters: &Parameters) {
        if self.state == State::Idle {
            return;
        }
        let room = self.chunk.capacity() - self.chunk.len();
        if !self.stream.has(room) && !self.is_flush_due(now) {
            return;
        }
        while !self.chunk.is_full()
            && let Some(byte) = self.stream.take(parameters, self.now)
        {
            // It is not full.
            let _ = self.chunk.push(byte);
        }
        if self.chunk.is_empty() {
            self.flushed_at = now;
        }
    }

    fn is_flush_due(&self, now: Instant) -> bool {
        self.state == State::Closing || now.us_since(self.flushed_at) >= FLUSH_INTERVAL_US
    }

    fn is_write_due(&self, now: Instant) -> bool {
        self.chunk.is_full() || (!self.chunk.is_empty() && self.is_flush_due(now))
    }

    fn next_program(&mut self) -> Option<LogStep> {
        let program = self.ring.as_mut()?.next_program(&self.chunk);
        match program {
            Ok(program) => Some(LogStep::Program {
                address: program.address(),
                bytes: Vec::from_slice(program.bytes()).ok()?,
            }),
            Err(error) => {
                self.stop(match error {
                    AppendError::NoErasedSpace => LogFailure::Full,
                    AppendError::Closed => LogFailure::NotWritten,
                });
                None
            }
        }
    }

    /// The outcome of programming.
    pub fn written(&mut self, outcome: Outcome, now: Instant) {
        let Some(ring) = &mut self.ring else { return };
        let bytes = ring.programmed(outcome);
        let rest = Chunk::from_slice(self.chunk.get(bytes..).unwrap_or_default());
        self.chunk = rest.unwrap_or_default();
        if outcome == Outcome::Failed {
            warn!("log: a page can't be written");
            self.stop(LogFailure::NotWritten);
        } else if self.chunk.is_empty() && !self.stream.has(1) {
            self.flushed_at = now;
        }
    }

    /// The outcome of an erase.
    pub fn erased(&mut self, erasure: Erasure, outcome: Outcome) {
        let Some(ring) = &mut self.ring else { return };
        ring.erased(erasure, outcome);
        match outcome {
            Outcome::Done => self.failed_erases = 0,
            Outcome::Failed => {
                warn!("log: a sector can't be erased");
                self.failed_erases = self.failed_erases.saturating_add(1);
                if self.failed_erases == MOST_FAILED_ERASES {
                    self.fail(LogFailure::NotWritten);
                }
            }
        }
    }

    /// The log ends here, and what waits is lost.
    fn stop(&mut self, failure: LogFailure) {
        self.close();
        self.fail(failure);
    }

    fn close(&mut self) {
        if let Some(ring) = &mut self.ring {
            ring.close();
        }
        self.chunk.clear();
        self.state = State::Idle;
    }

    /// Removes all files.
    pub fn erase_all(&mut self) {
        if let Some(ring) = &mut self.ring {
            ring.erase_all();
        }
        self.close();
    }
}
