//! The bytes of a log file, in their order, and the records that wait for the flash.

use heapless::Deque;

use crate::autopilot::packs::Packs;
use crate::memory::identity::BoardId;
use crate::pack::{Pack, PackSet};
use crate::parameter::{ParameterId, Parameters};
use crate::recorder::dataflash::{Record, RecordBytes, opening_record};
use crate::time::Instant;

/// A second of records at the log's share, the announcements of all packs in one tick, and an erase of 400 ms.
const QUEUE_BYTES: usize = 2048;

/// Subject of a log file.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    pub board_id: Option<BoardId>,
    pub packs: &'a Packs,
    pub parameters: &'a Parameters,
}

/// Records of a log file: formats, board and packs first, then events, and in between all parameters.
#[derive(Debug, Default)]
pub struct Stream {
    queue: Queue,
    opening: Opening,
    /// Packs to describe.
    packs: PackSet,
    /// The time of the formats: what happens meanwhile follows them.
    began: Instant,
    /// Of the opening's current record, what has not left yet.
    part: RecordBytes,
    /// Bytes of it that have.
    left: usize,
}

/// Progress of the records that begin a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Opening {
    /// The formats from this one on, then the board and the parameters.
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
        self.packs = PackSet::ALL;
    }

    /// When the file began.
    pub fn began(&self) -> Instant {
        self.began
    }

    /// Adds a record, and returns whether there was room for it.
    pub fn add(&mut self, record: &[u8]) -> bool {
        self.queue.add(record)
    }

    /// Describes a pack once more.
    pub fn describe(&mut self, pack: Pack) {
        self.packs.insert(pack);
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
        self.opening != Opening::Done
            || !self.packs.is_empty()
            || self.queue.len() + self.part.len() - self.left >= bytes
    }

    /// The byte that leaves next, at `now`.
    pub fn take(&mut self, subject: &Subject<'_>, now: Instant) -> Option<u8> {
        loop {
            if let Some(byte) = self.part.get(self.left) {
                self.left += 1;
                return Some(*byte);
            }
            self.left = 0;
            // Nothing may precede the formats.
            if let Some(part) = self.next_format(subject).or_else(|| self.next_pack(subject, now)) {
                self.part = part;
                continue;
            }
            self.part.clear();
            if let Some(byte) = self.queue.take() {
                return Some(byte);
            }
            self.part = self.next_parameter(subject.parameters, now)?;
        }
    }

    /// The next record of the formats, after which the board's follows.
    fn next_format(&mut self, subject: &Subject<'_>) -> Option<RecordBytes> {
        let Opening::Formats(number) = self.opening else {
            return None;
        };
        let time_us = self.began.as_micros();
        if let Some(record) = opening_record(number, time_us) {
            self.opening = Opening::Formats(number + 1);
            return Some(record);
        }
        self.opening = Opening::Parameters(0);
        subject.board_id.map(|id| Record::Board(id).encode(time_us))
    }

    /// The records of the next pack to describe.
    fn next_pack(&mut self, subject: &Subject<'_>, now: Instant) -> Option<RecordBytes> {
        // It is called for each byte that waits.
        if self.packs.is_empty() {
            return None;
        }
        let mut due = subject
            .packs
            .monitors()
            .filter(|(pack, _)| self.packs.contains(*pack));
        let Some((pack, monitor)) = due.next() else {
            self.packs = PackSet::NONE;
            return None;
        };
        self.packs.remove(pack);
        let state = subject.packs.bank.state(pack);
        let learnt = monitor.learnt_of_this(state);
        let mut records = Record::Pack(pack, state, learnt).encode(now.as_micros());
        if let Some(learnt) = learnt.filter(|learnt| learnt.has_curve()) {
            // Both are shorter than the longest record.
            let _ = records.extend_from_slice(&Record::Curve(pack, learnt).encode(now.as_micros()));
        }
        Some(records)
    }

    fn next_parameter(&mut self, parameters: &Parameters, now: Instant) -> Option<RecordBytes> {
        let Opening::Parameters(number) = self.opening else {
            return None;
        };
        let id = parameters.listed().nth(number);
        self.opening = match id {
            Some(_) => Opening::Parameters(number + 1),
            None => Opening::Done,
        };
        id.map(|id| parameter_record(id, parameters, now))
    }
}

/// The record of a parameter's value.
pub fn parameter_record(id: ParameterId, parameters: &Parameters, now: Instant) -> RecordBytes {
    let record = Record::Parameter {
        name: &id.name(),
        value: parameters.get(id),
        default: parameters.default_of(id),
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
