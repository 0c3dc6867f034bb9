//! Ids of nodes that have none: getting one from another node by the rules A to E of
//! `uavcan.protocol.dynamic_node_id.Allocation`, and giving them.

use core::hash::Hasher;

use hash32::{FnvHasher, Hasher as _};
use heapless::Vec;

use super::messages::{Allocation, UNIQUE_ID_BYTES};
use super::{MAX_NODES, NodeId};
use crate::time::Instant;

/// Pseudo-random numbers: xorshift of 32 bits (Marsaglia, *Xorshift RNGs*, 2003).
#[derive(Clone, Copy, Debug)]
pub(super) struct Random(u32);

impl Random {
    /// Another sequence for each seed.
    pub fn seeded(seed: u32) -> Self {
        // 0 would stay 0.
        Self(seed | 1)
    }

    /// The next number.
    pub fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// The next duration of `least_ms` to `most_ms` milliseconds, in microseconds.
    pub fn delay_us(&mut self, least_ms: u32, most_ms: u32) -> u64 {
        let range = (most_ms - least_ms).max(1);
        u64::from(least_ms + self.next() % range) * 1000
    }
}

/// The hash FNV-1a of 32 bits.
pub(super) fn fnv(bytes: &[u8]) -> u32 {
    let mut hasher = FnvHasher::default();
    hasher.write(bytes);
    hasher.finish32()
}

/// Bytes of the unique id in a request (`MAX_LENGTH_OF_UNIQUE_ID_IN_REQUEST`): it fits one frame.
const PART_BYTES: usize = 6;

/// Time between requests, in milliseconds (`MIN_REQUEST_PERIOD_MS`, `MAX_REQUEST_PERIOD_MS`).
const REQUEST_MS: (u32, u32) = (600, 1000);

/// Time before the next part, in milliseconds. The other side waits for 500, and this one may be late by 100.
const FOLLOW_UP_MS: (u32, u32) = (0, 350);

/// A node without an id.
#[derive(Debug)]
pub(super) struct Allocatee {
    unique_id: [u8; UNIQUE_ID_BYTES],
    /// Bytes of it that the other side has confirmed.
    confirmed: usize,
    due: Instant,
    random: Random,
}

/// A request to be sent, without an id.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Request {
    pub allocation: Allocation,
    /// Distinguishes nodes that send at the same time, 14 bits.
    pub discriminator: u16,
}

impl Allocatee {
    /// The first request is due after a random delay.
    pub fn new(unique_id: [u8; UNIQUE_ID_BYTES], mut random: Random, now: Instant) -> Self {
        let (least_ms, most_ms) = REQUEST_MS;
        Self {
            unique_id,
            confirmed: 0,
            due: now.after_us(random.delay_us(least_ms, most_ms)),
            random,
        }
    }

    /// The request that is due.
    pub fn poll(&mut self, now: Instant) -> Option<Request> {
        if now < self.due {
            return None;
        }
        let end = (self.confirmed + PART_BYTES).min(UNIQUE_ID_BYTES);
        let allocation = Allocation {
            node_id: None,
            is_first: self.confirmed == 0,
            unique_id: Vec::from_slice(self.unique_id.get(self.confirmed..end)?).ok()?,
        };
        self.restart(now);
        Some(Request {
            allocation,
            discriminator: self.random.next() as u16,
        })
    }

    /// Takes a request of another node: it goes first.
    pub fn give_way(&mut self, now: Instant) {
        self.restart(now);
    }

    /// Takes an answer. Returns the id, if it is for this node and has one.
    pub fn answer(&mut self, answer: &Allocation, now: Instant) -> Option<NodeId> {
        self.restart(now);
        if answer.unique_id.is_empty() || !self.unique_id.starts_with(&answer.unique_id) {
            return None;
        }
        if answer.unique_id.len() == UNIQUE_ID_BYTES {
            return answer.node_id;
        }
        let (least_ms, most_ms) = FOLLOW_UP_MS;
        self.confirmed = answer.unique_id.len();
        self.due = now.after_us(self.random.delay_us(least_ms, most_ms));
        None
    }

    fn restart(&mut self, now: Instant) {
        let (least_ms, most_ms) = REQUEST_MS;
        self.confirmed = 0;
        self.due = now.after_us(self.random.delay_us(least_ms, most_ms));
    }
}

/// Nodes that can be given an id.
const ASSIGNED: usize = MAX_NODES;

/// The highest id that is given away; those above are for tools.
const HIGHEST: u8 = 125;

/// Ids from this one on are preferred: below it owners set some by hand.
const LOWEST_PREFERRED: u8 = 64;

/// A request that is not continued in this time is dropped, in microseconds (`FOLLOWUP_TIMEOUT_MS`).
const FOLLOW_UP_US: u64 = 500_000;

/// Nothing is given away until nodes that have an id were heard, in microseconds: they report each second.
const LISTENING_US: u64 = 3_000_000;

/// Owners of ids.
#[derive(Debug)]
pub(super) struct Allocator {
    started: Instant,
    own_id: NodeId,
    /// The unique id that is being received, as far as it is.
    unique_id: Vec<u8, UNIQUE_ID_BYTES>,
    heard: Instant,
    assigned: Vec<Assigned, ASSIGNED>,
}

#[derive(Debug)]
struct Assigned {
    hash: u32,
    id: NodeId,
}

/// Result of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// Send the next part.
    Continue(Allocation),
    /// The node has this id from now on.
    Assigned(NodeId, Allocation),
    /// There is no id left.
    NoIdLeft,
}

impl Allocator {
    /// Of the node with this id.
    pub fn new(own_id: NodeId, now: Instant) -> Self {
        Self {
            started: now,
            own_id,
            unique_id: Vec::new(),
            heard: Instant::EPOCH,
            assigned: Vec::new(),
        }
    }

    /// Takes a request. `is_on_bus` says whether another node uses an id.
    pub fn request(
        &mut self,
        request: &Allocation,
        now: Instant,
        is_on_bus: impl Fn(NodeId) -> bool,
    ) -> Option<Answer> {
        if now.us_since(self.started) < LISTENING_US {
            return None;
        }
        let is_late = now.us_since(self.heard) > FOLLOW_UP_US;
        if is_late || request.is_first {
            self.unique_id.clear();
        }
        if !request.is_first && self.unique_id.is_empty() {
            return None;
        }
        self.heard = now;
        if self.unique_id.extend_from_slice(&request.unique_id).is_err() {
            self.unique_id.clear();
            return None;
        }
        if self.unique_id.len() < UNIQUE_ID_BYTES {
            return Some(Answer::Continue(self.answer(None)));
        }
        let answer = match self.assign(request.node_id, is_on_bus) {
            Some(id) => Answer::Assigned(id, self.answer(Some(id))),
            None => Answer::NoIdLeft,
        };
        self.unique_id.clear();
        Some(answer)
    }

    fn answer(&self, node_id: Option<NodeId>) -> Allocation {
        Allocation {
            node_id,
            is_first: false,
            unique_id: self.unique_id.clone(),
        }
    }

    fn assign(&mut self, wanted: Option<NodeId>, is_on_bus: impl Fn(NodeId) -> bool) -> Option<NodeId> {
        let hash = fnv(&self.unique_id);
        if let Some(known) = self.assigned.iter().find(|known| known.hash == hash) {
            return Some(known.id);
        }
        let is_free = |id: &NodeId| {
            *id != self.own_id && !is_on_bus(*id) && self.assigned.iter().all(|known| known.id != *id)
        };
        let id = candidates(wanted, hash).find(is_free)?;
        self.assigned.push(Assigned { hash, id }).ok()?;
        Some(id)
    }
}

/// The ids in the order of preference: from the wanted one upwards, then downwards. Who wants none gets one by its unique
/// id, so that it is the same after a restart of this board.
fn candidates(wanted: Option<NodeId>, hash: u32) -> impl Iterator<Item = NodeId> {
    let range = u32::from(HIGHEST - LOWEST_PREFERRED) + 1;
    let preferred = LOWEST_PREFERRED + (hash % range) as u8;
    let first = wanted
        .map(NodeId::number)
        .filter(|id| *id <= HIGHEST)
        .unwrap_or(preferred);
    (first..=HIGHEST).chain((1..first).rev()).filter_map(NodeId::new)
}
