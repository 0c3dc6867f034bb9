//! The next flash operation of the log.

use heapless::Vec;

use super::share::erase_target;
use super::stream::Subject;
use super::{Chunk, LogFailure, MOST_FAILED_ERASES, PAGE_BYTES, Recording, State, is_on};
use crate::log::warn;
use crate::memory::storage::Erase;
use crate::recorder::{AppendError, Erasure, LogFile, Program};
use crate::time::Instant;

/// With the interval at which the flash is looked after, at most a second is lost when the power goes.
const FLUSH_INTERVAL_US: u64 = 700_000;

/// The interval with erases in between: each may take 400 ms, and a pause as long follows.
const FLUSH_INTERVAL_WITH_ERASES_US: u64 = 150_000;

/// A flash operation of the log. Each has its report: [`Autopilot::log_written`](super::super::Autopilot::log_written),
/// [`Autopilot::log_erased`](super::super::Autopilot::log_erased).
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap, and one of it exists at a time"
)]
pub enum LogStep {
    /// Program these bytes, which are blank.
    Program {
        /// Offset from the start of the flash.
        address: u32,
        /// Content, within one page.
        bytes: Vec<u8, PAGE_BYTES>,
    },
    /// Erase a sector and program its mark, before the rover can be armed.
    Erase(Erasure),
}

impl LogStep {
    pub(super) fn program(program: &Program<'_>) -> Self {
        Self::Program {
            address: program.address(),
            // It is within one page.
            bytes: Vec::from_slice(program.bytes()).unwrap_or_default(),
        }
    }
}

impl Recording {
    /// The next operation at `now`, if there is one.
    pub fn next_step(&mut self, now: Instant, subject: &Subject<'_>, may_erase: Erase) -> Option<LogStep> {
        if let Some(date) = self.next_date() {
            return Some(date);
        }
        let is_flush_due = self.is_flush_due(now, may_erase);
        if is_flush_due || self.stream.has(self.chunk.capacity() - self.chunk.len()) {
            self.fill_chunk(now, subject);
        }
        if self.chunk.is_full() || (!self.chunk.is_empty() && is_flush_due) {
            match self.next_program() {
                Ok(program) => return Some(program),
                // The next sector can't be used. Another file can begin behind it.
                Err(AppendError::Closed) => self.close(),
                Err(AppendError::NoErasedSpace) => {
                    return self.next_erase(subject, may_erase).or_else(|| self.run_out());
                }
            }
        }
        if self.state == State::Closing && self.chunk.is_empty() {
            self.close();
        }
        self.next_erase(subject, may_erase)
    }

    /// The program of the date into the open file's first sector, if it is recorded and not there yet.
    fn next_date(&mut self) -> Option<LogStep> {
        let program = self.ring.as_mut()?.next_date(self.date.file_began_utc_s?)?;
        Some(LogStep::program(&program))
    }

    fn is_flush_due(&self, now: Instant, may_erase: Erase) -> bool {
        let interval_us = match may_erase {
            Erase::Allowed => FLUSH_INTERVAL_WITH_ERASES_US,
            Erase::Forbidden => FLUSH_INTERVAL_US,
        };
        self.is_urgent || self.state == State::Closing || now.us_since(self.flushed_at) >= interval_us
    }

    /// Takes as much out of the stream as a page holds.
    fn fill_chunk(&mut self, now: Instant, subject: &Subject<'_>) {
        if self.state == State::Idle {
            return;
        }
        while !self.chunk.is_full()
            && let Some(byte) = self.stream.take(subject, self.now)
        {
            // It is not full.
            let _ = self.chunk.push(byte);
        }
        if self.chunk.is_empty() {
            self.flushed_at = now;
        }
    }

    fn next_program(&mut self) -> Result<LogStep, AppendError> {
        let ring = self.ring.as_mut().ok_or(AppendError::Closed)?;
        let program = ring.next_program(&self.chunk)?;
        Ok(LogStep::program(&program))
    }

    /// Without a log nothing is erased ahead; what an erase of all files has left is.
    fn next_erase(&mut self, subject: &Subject<'_>, may_erase: Erase) -> Option<LogStep> {
        if may_erase == Erase::Forbidden || self.failed_erases >= MOST_FAILED_ERASES {
            return None;
        }
        let ring = self.ring.as_mut()?;
        let is_read = |file: LogFile| self.readers.is_read(file.number, self.now);
        if ring.next_erased_file().is_some_and(is_read) {
            return None;
        }
        let target = if is_on(subject.parameters) {
            erase_target(ring)
        } else {
            0
        };
        ring.next_erase(target).map(LogStep::Erase)
    }

    /// All erased space is used up.
    fn run_out(&mut self) -> Option<LogStep> {
        self.stop(LogFailure::Full);
        None
    }

    /// The outcome of programming.
    pub fn written(&mut self, outcome: Result<(), ()>, now: Instant) {
        let Some(ring) = &mut self.ring else { return };
        let bytes = ring.programmed(outcome);
        let rest = Chunk::from_slice(self.chunk.get(bytes..).unwrap_or_default());
        self.chunk = rest.unwrap_or_default();
        if outcome.is_err() {
            warn!("log: a page can't be written");
            self.stop(LogFailure::NotWritten);
        } else if self.chunk.is_empty() && !self.stream.has(1) {
            self.flushed(now);
        }
    }

    /// Everything is in flash.
    fn flushed(&mut self, now: Instant) {
        self.flushed_at = now;
        self.crash_is_due = false;
        self.is_urgent = false;
        if self.failure == Some(LogFailure::NotWritten) {
            self.failure = None;
        }
    }

    /// The outcome of an erase.
    pub fn erased(&mut self, erasure: Erasure, outcome: Result<(), ()>) {
        let Some(ring) = &mut self.ring else { return };
        ring.erased(erasure, outcome);
        match outcome {
            Ok(()) => self.failed_erases = 0,
            Err(()) => {
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
