//! The bytes of a log file, in their order, and the records that wait for the flash.

use heapless::Deque;

use crate::parameter::{ParameterId, Parameters};
use crate::recorder::dataflash::{Record, RecordBytes, opening_record};
use crate::time::Instant;

/// A second of records at the log's share, the announcements of all packs in one tick, and an erase of 400 ms.
const QUEUE_BYTES: usize = 2048;

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

    /// When the file began.
    pub fn began(&self) -> Instant {
        self.began
    }

    /// Adds a record, and returns whether there was room for it.
    pub fn add(&mut self, record: &[u8]) -> bool {
        self.queue.add(record)
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

/// Encoded records that wait for the flash, whole ones only.
#[derive(Debug, Default)]
struct Queue {
    bytes: Deque<u8, QUEUE_BYTES>,
    dropped: u32,
}

impl Queue {
    /// Adds a record, and returns whether there was room for it. Otherwise it is dropped and counted.
    fn add(&mut self, record: &[u8]) -> bool {
        if self.bytes.capacity() - self.bytes.len() < record.len() {
            self.dropped = self.dropped.saturating_add(1);
            return false;
        }
        for byte in record {
            // There is room for all of it.
            let _ = self.bytes.push_back(*byte);
        }
        true
    }

    /// The byte that leaves next.
    fn take(&mut self) -> Option<u8> {
        self.bytes.pop_front()
    }

    /// Bytes that wait.
    fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Records dropped so far.
    fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Forgets what waits.
    fn clear(&mut self) {
        self.bytes.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_without_room_is_dropped_whole_and_counted() {
        let mut queue = Queue::default();
        for _ in 0..QUEUE_BYTES / 100 {
            queue.add(&[1; 100]);
        }
        queue.add(&[2; 100]);
        assert_eq!((queue.len(), queue.dropped()), (QUEUE_BYTES / 100 * 100, 1));
        queue.add(&[3; 10]);
        let taken: Vec<u8> = std::iter::from_fn(|| queue.take()).collect();
        assert_eq!(taken[taken.len() - 10..], [3; 10]);
        assert!(!taken.contains(&2));
    }
}
