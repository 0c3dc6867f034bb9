//! Replay protection: the latest timestamp of each sender on each of its links.

use core::num::NonZeroU32;

use heapless::Vec;

use super::{Authenticity, Timestamp};
use crate::time::Instant;

/// Senders that are distinguished at the same time, as in ArduPilot.
const STREAMS: usize = 16;

/// A frame may be so far behind our time: it may have been under way while another one's came. What is older may be a
/// recording of a frame that was jammed, even if its sender was silent since.
const MAX_AGE: u64 = 60 * Timestamp::PER_SECOND;

/// One sender on one of its links: their timestamps only grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamId(NonZeroU32);

impl StreamId {
    pub fn new(system_id: u8, component_id: u8, link: u8) -> Self {
        // In a word they are compared at once.
        Self(NonZeroU32::MIN | u32::from_be_bytes([system_id, component_id, link, 0]))
    }
}

#[derive(Clone, Copy, Debug)]
struct Stream {
    id: StreamId,
    /// When it was heard, by our own clock, in 2^16 µs: enough for 8 years.
    heard_at: u32,
    latest: Timestamp,
}

/// Why a sender is not forgotten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mavlink) enum Role {
    /// Its sticks drive.
    Drives,
    /// It has armed the rover.
    Armed,
}

/// The latest timestamp of each sender.
#[derive(Clone, Debug)]
pub struct Streams {
    known: Vec<Stream, STREAMS>,
    /// Latest time of any sender that is not known any more.
    forgotten: Timestamp,
    driver: Option<StreamId>,
    armed_by: Option<StreamId>,
}

impl Streams {
    /// No sender is known, and nothing up to `forgotten` counts again.
    pub fn after(forgotten: Timestamp) -> Self {
        Self {
            known: Vec::new(),
            forgotten,
            driver: None,
            armed_by: None,
        }
    }

    /// No sender is known any more, and nothing up to `forgotten` counts.
    pub fn forget(&mut self, forgotten: Timestamp) {
        self.known.clear();
        self.forgotten = forgotten;
    }

    /// Judges a frame with this time; every frame of its sender with this time or an earlier one is overtaken from now on. `ours`
    /// is our own time.
    pub fn hear(&mut self, id: StreamId, time: Timestamp, ours: Timestamp, now: Instant) -> Authenticity {
        let is_recent = time.later(MAX_AGE) >= ours;
        let heard = Stream {
            id,
            latest: time,
            heard_at: (now.as_micros() >> 16) as u32,
        };
        match self.known.iter_mut().find(|stream| stream.id == id) {
            Some(known) if time <= known.latest => {
                return Authenticity::Overtaken {
                    may_disarm: is_recent,
                    may_hold: is_recent,
                };
            }
            Some(known) => *known = heard,
            None if !is_recent || time <= self.forgotten => return Authenticity::TooOld,
            None => self.add(heard),
        }
        if is_recent {
            Authenticity::Proven
        } else {
            Authenticity::Late
        }
    }

    /// This sender is not forgotten while it has this role.
    pub fn keep(&mut self, id: StreamId, role: Role) {
        let place = match role {
            Role::Drives => &mut self.driver,
            Role::Armed => &mut self.armed_by,
        };
        *place = Some(id);
    }

    /// Remembers one more sender. When there are too many, the one that we heard longest ago is forgotten, and so is
    /// everybody's past up to its latest time.
    fn add(&mut self, stream: Stream) {
        let Err(stream) = self.known.push(stream) else {
            return;
        };
        let kept = [self.driver, self.armed_by];
        let others = self
            .known
            .iter_mut()
            .filter(|known| !kept.contains(&Some(known.id)));
        if let Some(oldest) = others.min_by_key(|known| known.heard_at) {
            self.forgotten = self.forgotten.max(oldest.latest);
            *oldest = stream;
        }
    }
}
