//! Getting an id from another node: the rules A to E of `uavcan.protocol.dynamic_node_id.Allocation`.

use heapless::Vec;

use super::NodeId;
use super::messages::{Allocation, Part, UNIQUE_ID_BYTES};
use super::random::Random;
use crate::time::Instant;

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
            part: if self.confirmed == 0 {
                Part::First
            } else {
                Part::Later
            },
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
