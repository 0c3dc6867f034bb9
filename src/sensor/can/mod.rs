//! Packs that are measured by nodes on a DroneCAN bus.
//!
//! Transfers are our own: the crate `dronecan` 0.2 only receives, from one source and of one type at a time, and after a transfer
//! whose last frame is lost it loses the next one, too.
//!
//! Frames become transfers (`transfers`), transfers messages (`messages`), and these readings of packs (`packs`). Nothing
//! here reads a clock or knows the controller.

mod allocation;
mod bus;
mod charger;
mod dronecan;
mod event;
mod frame;
mod messages;
mod nodes;
mod packs;
mod setup;
#[cfg(test)]
mod tests;
mod transfers;

pub use bus::{Acceptance, BitTiming, CanBus, CanFilters, CanInterrupt, CanReport, CanState, CanStatus};
pub use dronecan::DroneCan;
pub use event::{CanEvent, CanNotice, ChargerPower};
pub use frame::{CanFrame, FRAME_BYTES, NodeId};
pub use setup::{CanOptions, CanPack, CanSettings, CanSetup, TemperatureMessages};

use crate::pack::MAX_PACKS;
use crate::parameter::MAX_CONTROLLERS;

/// Nodes that a bus has room for: all motor controllers, a battery or charger for each pack, and three more, such as one that
/// gives ids. Everything that is kept of each node has as many places.
const MAX_NODES: usize = MAX_CONTROLLERS + MAX_PACKS + 3;
