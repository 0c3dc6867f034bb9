//! Packs that are measured by nodes on a DroneCAN bus. Why it is our own: `docs/decisions/0059-dronecan.md`.
//!
//! Frames become transfers (`assembler`), transfers messages (`messages`), and these readings of packs (`packs`). Nothing
//! here reads a clock or knows the controller.

mod acceptance;
mod allocatee;
mod allocator;
mod assembler;
mod bit_timing;
mod bits;
mod charger;
mod condition;
mod crc;
mod dronecan;
mod event;
mod frame;
mod identifier;
mod messages;
mod node_id;
mod node_info;
mod nodes;
mod outgoing;
mod packs;
mod random;
mod setup;
mod status;
mod tail;
#[cfg(test)]
mod tests;

pub use acceptance::{Acceptance, CanFilters};
pub use bit_timing::BitTiming;
pub use dronecan::DroneCan;
pub use event::{CanEvent, CanNotice, ChargerPower};
pub use frame::{CanFrame, FRAME_BYTES};
pub use node_id::NodeId;
pub use setup::{CanOptions, CanPack, CanSettings, CanSetup};
pub use status::{CanInterrupt, CanReport, CanState, CanStatus};

use crate::pack::MAX_PACKS;
use crate::parameter::MAX_CONTROLLERS;

/// Nodes that a bus has room for: all motor controllers, a battery or charger for each pack, and three more, such as one that
/// gives ids. Everything that is kept of each node has as many places.
const MAX_NODES: usize = MAX_CONTROLLERS + MAX_PACKS + 3;
