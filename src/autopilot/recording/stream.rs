//! The bytes of a log file, in their order.

use super::queue::Queue;
use crate::parameter::{ParameterId, Parameters};
use crate::recorder::dataflash::{Record, RecordBytes, opening_record};
use crate::time::Instant;

/// What a log file is made of: formats first, then what happens, and in between all parameters.
#[derive(Debug, Default)]
pub(super) struct Stream {
    queue: Queue,
    opening: Opening,
    /// The time of the formats: what happens meanwhile follows them.
    began: Instant,
    /// Of the opening's current record, what has not left yet.
    part: RecordBytes,
    /// How much of it has.
    left: usize,
}

/// What a file begins with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Opening {
    /// The formats from this one on, then the parameters.
    Formats(usize),
    /// The parameters from this one on.
    Parameters(usize),
    /// All of it has left.
    #[default]
    Done,
}

impl Stream {
    /// Begins another file at `now`. What waits is for the file before.
    pub fn begin(&mut self, now: Instant) {
        self.began = now;
        self.queue.clear();
        self.part.clear();
        self.left = 0;
        self.opening = Opening::Formats(0);
    }

    /// Adds a record.
    pub fn add(&mut self, record: &[u8]) {
        self.queue.add(record);
    }

    /// Writes all parameters once more.
    pub fn repeat_parameters(&mut self) {
        if let Opening::Parameters(_) | Opening::Done = self.opening {
            self.opening = Opening::Parameters(0);
        }
    }

    /// Records that were dropped for lack of room so far.
    pub fn dropped(&self) -> u32 {
        self.queue.dropped()
    }

    /// Whether this many bytes could leave now.
    pub fn has(&self, bytes: usize) -> bool {
        self.opening != Opening::Done || self.queue.len() + self.part.len() - self.left >= bytes
    }

    /// The byte that leaves next, at `now`.
    pub fn take(&mut self, parameters: &Parameters, now: Instant) -> Option<u8> {
        loop {
            if let Some(byte) = self.part.get(self.left) {
                self.left += 1;
                return Some(*byte);
            }
            // Nothing may precede the formats.
            if !matches!(self.opening, Opening::Formats(_))
                && let Some(byte) = self.queue.take()
            {
                return Some(byte);
            }
            self.part = self.next_of_opening(parameters, now)?;
            self.left = 0;
        }
    }

    fn next_of_opening(&mut self, parameters: &Parameters, now: Instant) -> Option<RecordBytes> {
        if let Opening::Formats(number) = self.opening {
            if let Some(record) = opening_record(number, self.began.as_micros()) {
                self.opening = Opening::Formats(number + 1);
                return Some(record);
            }
            self.opening = Opening::Parameters(0);
        }
        if let Opening::Parameters(number) = self.opening {
            if let Some(id) = parameters.listed().nth(number) {
                self.opening = Opening::Parameters(number + 1);
                return Some(parameter_record(id, parameters, now));
            }
            self.opening = Opening::Done;
        }
        None
    }
}

/// The record of a parameter's value.
pub(super) fn parameter_record(id: ParameterId, parameters: &Parameters, now: Instant) -> RecordBytes {
    let record = Record::Parameter {
        name: &id.name(),
        value: parameters.get(id),
        default: id.default_value(),
    };
    record.encode(now.as_micros())
}
