//! Packs that are measured by nodes on a DroneCAN bus.

mod frame;

pub use frame::{CanFrame, FRAME_BYTES};
