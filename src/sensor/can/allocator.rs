//! Giving ids to nodes that have none, as ArduPilot does: the rules of `uavcan.protocol.dynamic_node_id.Allocation`.

use heapless::Vec;

use super::messages::{Allocation, Part, UNIQUE_ID_BYTES};
use super::{MAX_NODES, NodeId};
use crate::fnv::Fnv;
use crate::time::Instant;

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

/// Who has which id.
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

/// What a request leads to.
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
        if is_late || request.part == Part::First {
            self.unique_id.clear();
        }
        if request.part == Part::Later && self.unique_id.is_empty() {
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
            part: Part::Later,
            unique_id: self.unique_id.clone(),
        }
    }

    fn assign(&mut self, wanted: Option<NodeId>, is_on_bus: impl Fn(NodeId) -> bool) -> Option<NodeId> {
        let hash = Fnv::hash_of(&self.unique_id);
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
