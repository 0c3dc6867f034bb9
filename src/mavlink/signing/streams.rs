//! Replay protection: the latest timestamp of each sender on each of its links.

use heapless::Vec;

use super::Timestamp;

/// Senders that are distinguished at the same time, as in ArduPilot.
const STREAMS: usize = 16;

/// A frame may be so far behind our time: it may have been under way while another one's came. What is older may be a
/// recording of a frame that was jammed, so it is dropped even if its sender was silent since.
const MAX_AGE: u64 = 60 * Timestamp::PER_SECOND;

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
#[derive(Clone, Debug)]
pub(super) struct Streams {
    known: Vec<Stream, STREAMS>,
    /// What a sender who is not known any more has sent is not later than this.
    forgotten: Timestamp,
}

impl Streams {
    /// No sender is known, and nothing up to `forgotten` counts again.
    pub fn after(forgotten: Timestamp) -> Self {
        Self {
            known: Vec::new(),
            forgotten,
        }
    }

    /// Whether a frame with this time is a new one of its sender; then no frame with this time or an earlier one is, from
    /// now on. `now` is our own time.
    pub fn accept(&mut self, id: StreamId, time: Timestamp, now: Timestamp) -> bool {
        let known = self.known.iter_mut().find(|stream| stream.id == id);
        let latest = known.as_ref().map_or(self.forgotten, |stream| stream.latest);
        let is_new = time > latest && time.later(MAX_AGE) >= now;
        match known {
            _ if !is_new => {}
            Some(stream) => stream.latest = time,
            None => self.add(Stream { id, latest: time }),
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
