//! Nodes: which of them are on the bus, and what this one is.

use heapless::Vec;

use super::messages::{NodeStatus, UNIQUE_ID_BYTES};
use super::{CanNotice, MAX_NODES, NodeId};
use crate::memory::identity::FirmwareHash;
use crate::time::Instant;

/// As the names of other nodes, a reversed domain.
const NAME: &[u8] = b"org.rover-battmon";

/// Status, version of the program, version of the board with its unique id and without a certificate, name.
const BYTES: usize = NodeStatus::BYTES + 15 + 2 + UNIQUE_ID_BYTES + 1 + NAME.len();

/// The version's `optional_field_flags`: the program's hash is known.
const HAS_IMAGE_CRC: u8 = 2;

const MAJOR: u8 = number(env!("CARGO_PKG_VERSION_MAJOR"));
const MINOR: u8 = number(env!("CARGO_PKG_VERSION_MINOR"));

const fn number(digits: &str) -> u8 {
    match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => panic!("a version is a number below 256"),
    }
}

/// Facts of this node.
#[derive(Debug)]
pub(super) struct NodeInfo {
    pub uptime_s: u32,
    pub unique_id: [u8; UNIQUE_ID_BYTES],
    pub firmware_hash: Option<FirmwareHash>,
}

impl NodeInfo {
    /// The payload.
    pub fn to_bytes(&self) -> Vec<u8, BYTES> {
        let flags = self.firmware_hash.map_or(0, |_| HAS_IMAGE_CRC);
        let hash = self.firmware_hash.map_or(0, FirmwareHash::number);
        let mut bytes = Vec::new();
        for part in [
            &NodeStatus::of_working_node(self.uptime_s)[..],
            &[MAJOR, MINOR, flags],
            // No commit.
            &[0; 4],
            &u64::from(hash).to_le_bytes(),
            // The board has no version.
            &[0; 2],
            &self.unique_id,
            // No certificate.
            &[0],
            NAME,
        ] {
            // They all fit.
            let _ = bytes.extend_from_slice(part);
        }
        bytes
    }
}

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
        if status.is_leaving {
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
