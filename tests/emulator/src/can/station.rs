//! A node with a queue: sends what it was given at its times, and keeps what it hears.

use std::collections::VecDeque;

use super::super::clock::Cycle;
use super::{CanFrame, CanNode, Confinement};

/// What is kept of what it hears.
const MOST_RECEIVED: usize = 65_536;

pub struct Station {
    /// `None` while it is unplugged.
    bit: Option<Cycle>,
    confinement: Confinement,
    /// Each with the time from which it may be sent, in the order in which they are sent.
    queue: VecDeque<(Cycle, CanFrame)>,
    received: VecDeque<(Cycle, CanFrame)>,
}

impl Station {
    /// A node with bits of this length.
    pub fn new(bit: Cycle) -> Self {
        Self {
            bit: Some(bit),
            confinement: Confinement::default(),
            queue: VecDeque::new(),
            received: VecDeque::new(),
        }
    }

    /// Sends a frame from `at` on, behind those that wait already. It is repeated until it is through.
    pub fn send(&mut self, at: Cycle, frame: CanFrame) {
        self.queue.push_back((at, frame));
    }

    /// Unplugs it, or plugs it in with bits of this length. What waits is lost.
    pub fn set_bit(&mut self, bit: Option<Cycle>) {
        self.confinement = Confinement::default();
        self.queue.clear();
        self.bit = bit;
    }

    /// Frames that wait.
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// What was heard since this was asked last, with the time of each end.
    pub fn take_received(&mut self) -> Vec<(Cycle, CanFrame)> {
        self.received.drain(..).collect()
    }
}

impl CanNode for Station {
    fn attachment(&self) -> Option<Cycle> {
        self.bit
    }

    fn confinement(&self) -> &Confinement {
        &self.confinement
    }

    fn confinement_mut(&mut self) -> &mut Confinement {
        &mut self.confinement
    }

    fn ready_from(&self) -> Option<Cycle> {
        self.queue.front().map(|(at, _)| *at)
    }

    fn begin(&mut self, _now: Cycle) -> Option<CanFrame> {
        self.queue.front().map(|(_, frame)| frame.clone())
    }

    fn sent(&mut self, _now: Cycle) {
        self.queue.pop_front();
    }

    fn lost_arbitration(&mut self, _now: Cycle) {}

    fn failed(&mut self, _now: Cycle) {}

    fn received(&mut self, frame: &CanFrame, now: Cycle) {
        if self.received.len() == MOST_RECEIVED {
            self.received.pop_front();
        }
        self.received.push_back((now, frame.clone()));
    }
}
