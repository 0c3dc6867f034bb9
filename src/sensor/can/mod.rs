//! Packs that are measured by nodes on a DroneCAN bus.

mod bit_timing;
mod dronecan;
mod frame;
mod status;

pub use bit_timing::BitTiming;
pub use dronecan::{Acceptance, CanEvent, CanNotice, CanSettings, CanSetup, DroneCan};
pub use frame::{CanFrame, FRAME_BYTES};
pub use status::{CanInterrupt, CanReport, CanState, CanStatus};
