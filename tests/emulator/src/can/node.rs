//! What a node at the bus has to answer.

use super::super::clock::Cycle;
use super::{CanFrame, Confinement};

/// A CAN controller with its transceiver.
pub trait CanNode {
    /// The length of its bits; `None` while it is not at the bus.
    fn attachment(&self) -> Option<Cycle>;

    fn confinement(&self) -> &Confinement;

    fn confinement_mut(&mut self) -> &mut Confinement;

    /// From when on it has a frame to send; `None` while it has none.
    fn ready_from(&self) -> Option<Cycle>;

    /// Begins to send. Only called after [`Self::ready_from`].
    fn begin(&mut self, now: Cycle) -> Option<CanFrame>;

    /// The frame that it has begun is through.
    fn sent(&mut self, now: Cycle);

    /// The frame that it has begun is not through: a stronger identifier was sent.
    fn lost_arbitration(&mut self, now: Cycle);

    /// The frame that it has begun is not through: there was an error.
    fn failed(&mut self, now: Cycle);

    /// A frame of another node.
    fn received(&mut self, frame: &CanFrame, now: Cycle);

    /// An error in a frame of another node.
    fn disturbed(&mut self, _now: Cycle) {}

    /// Its error counters may have changed otherwise.
    fn state_changed(&mut self, _now: Cycle) {}
}
