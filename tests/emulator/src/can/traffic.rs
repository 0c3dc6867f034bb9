//! Other traffic: a node that takes a share of the bus, with identifiers that win or lose against the others.

use super::super::clock::Cycle;
use super::super::random::Random;
use super::{CanFrame, CanNode, Confinement};

/// It is behind by this at most: what it had no chance to send is left out.
const MOST_BEHIND: Cycle = super::super::clock::cycles(10_000);

pub struct Traffic {
    bit: Cycle,
    id: u32,
    share: f64,
    due: Cycle,
    next: CanFrame,
    confinement: Confinement,
    random: Random,
    sent: u64,
}

impl Traffic {
    /// Frames of eight bytes of chance, all with this identifier, that take `share` of the time if they win.
    pub fn new(bit: Cycle, id: u32, share: f64, from: Cycle) -> Self {
        let mut random = Random::new(u64::from(id));
        Self {
            bit,
            id,
            share,
            due: from,
            next: frame(id, &mut random),
            confinement: Confinement::default(),
            random,
            sent: 0,
        }
    }

    /// Frames that went through.
    pub fn sent_frames(&self) -> u64 {
        self.sent
    }

    /// Changes the share; 0 ends it.
    pub fn set_share(&mut self, share: f64) {
        self.share = share;
    }
}

fn frame(id: u32, random: &mut Random) -> CanFrame {
    CanFrame::extended(id, &random.next_u64().to_le_bytes())
}

impl CanNode for Traffic {
    fn attachment(&self) -> Option<Cycle> {
        Some(self.bit)
    }

    fn confinement(&self) -> &Confinement {
        &self.confinement
    }

    fn confinement_mut(&mut self) -> &mut Confinement {
        &mut self.confinement
    }

    fn ready_from(&self) -> Option<Cycle> {
        (self.share > 0.0).then_some(self.due)
    }

    fn begin(&mut self, _now: Cycle) -> Option<CanFrame> {
        Some(self.next.clone())
    }

    fn sent(&mut self, now: Cycle) {
        let length = self.next.bits() * self.bit;
        if self.share > 0.0 {
            self.due += (length as f64 / self.share) as Cycle;
        }
        self.due = self.due.max(now.saturating_sub(MOST_BEHIND));
        self.next = frame(self.id, &mut self.random);
        self.sent += 1;
    }

    fn lost_arbitration(&mut self, _now: Cycle) {}

    fn failed(&mut self, _now: Cycle) {}

    fn received(&mut self, _frame: &CanFrame, _now: Cycle) {}
}
