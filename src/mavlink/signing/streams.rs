//! Whom we have heard, so that nobody's frame counts twice.

use heapless::Vec;

use super::Timestamp;

/// Senders that are told apart at the same time, as in ArduPilot.
const STREAMS: usize = 16;

/// A sender that is new may be so far behind: its frame may have been under way while another one's came.
const OLDEST_OF_A_NEW_STREAM: u64 = 60 * Timestamp::PER_SECOND;

/// One sender on one of its links: their timestamps only grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StreamId {
    pub system_id: u8,
    pub component_id: u8,
    pub link: u8,
}

#[derive(Clone, Copy, Debug)]
struct Stream {
    id: StreamId,
    latest: Timestamp,
}

/// The latest timestamp of each sender.
#[derive(Debug)]
pub(super) struct Streams {
    known: Vec<Stream, STREAMS>,
    /// What a sender who is not known any more has sent is not later than this.
    forgotten: Timestamp,
}

impl Streams {
    /// Nobody is known, and nothing up to `forgotten` counts again.
    pub fn after(forgotten: Timestamp) -> Self {
        Self {
            known: Vec::new(),
            forgotten,
        }
    }

    /// Whether a frame with this time is a new one of its sender; then no frame with this time or an earlier one is, from
    /// now on. `now` is our own time.
    pub fn accept(&mut self, id: StreamId, time: Timestamp, now: Timestamp) -> bool {
        if let Some(stream) = self.known.iter_mut().find(|stream| stream.id == id) {
            let is_new = time > stream.latest;
            stream.latest = stream.latest.max(time);
            return is_new;
        }
        let is_new = time > self.forgotten && time.later(OLDEST_OF_A_NEW_STREAM) >= now;
        if is_new {
            self.add(Stream { id, latest: time });
        }
        is_new
    }

    /// Remembers one more sender. When there are too many, the one that has been silent for longest is forgotten, and
    /// so is everybody's past up to then.
    fn add(&mut self, stream: Stream) {
        let Err(stream) = self.known.push(stream) else {
            return;
        };
        if let Some(oldest) = self.known.iter_mut().min_by_key(|known| known.latest) {
            self.forgotten = self.forgotten.max(oldest.latest);
            *oldest = stream;
        }
    }
}
