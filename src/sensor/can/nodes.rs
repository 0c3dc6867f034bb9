//! Nodes that are on the bus.

use heapless::Vec;

use super::messages::{NodeStatus, Presence};
use super::{CanNotice, MAX_NODES, NodeId};
use crate::time::Instant;

/// Nodes that are watched. Further ones are served, too, but neither announced nor kept from being given away.
const WATCHED: usize = MAX_NODES;

/// A node that has been silent for this long is lost, in microseconds (`OFFLINE_TIMEOUT_MS` of `NodeStatus`).
const LOST_AFTER_US: u64 = 3_000_000;

/// Nodes that have reported their status.
#[derive(Debug, Default)]
pub(super) struct Nodes(Vec<Node, WATCHED>);

#[derive(Debug)]
struct Node {
    id: NodeId,
    heard: Instant,
    uptime_s: u32,
}

impl Nodes {
    /// Takes a node's status. Returns what it changes.
    pub fn report(&mut self, id: NodeId, status: &NodeStatus, now: Instant) -> Option<CanNotice> {
        if status.presence == Presence::Leaving {
            return self.remove(|node| node.id == id);
        }
        let Some(node) = self.0.iter_mut().find(|node| node.id == id) else {
            let node = Node {
                id,
                heard: now,
                uptime_s: status.uptime_s,
            };
            return self.0.push(node).ok().map(|()| CanNotice::Appeared(id));
        };
        let has_restarted = status.uptime_s < node.uptime_s;
        node.heard = now;
        node.uptime_s = status.uptime_s;
        has_restarted.then_some(CanNotice::Restarted(id))
    }

    /// Takes a node off that is silent for too long; the next one by another call.
    pub fn next_lost(&mut self, now: Instant) -> Option<CanNotice> {
        self.remove(|node| now.us_since(node.heard) > LOST_AFTER_US)
    }

    /// Whether the node is on the bus.
    pub fn has(&self, id: NodeId) -> bool {
        self.0.iter().any(|node| node.id == id)
    }

    /// Whether there may be others than those known.
    pub fn is_full(&self) -> bool {
        self.0.is_full()
    }

    fn remove(&mut self, is_gone: impl Fn(&Node) -> bool) -> Option<CanNotice> {
        let index = self.0.iter().position(is_gone)?;
        let node = (index < self.0.len()).then(|| self.0.swap_remove(index))?;
        Some(CanNotice::Lost(node.id))
    }
}
