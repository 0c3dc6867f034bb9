//! The board's CAN controller at its pins, and peers at its bus. They send transfers that an independent implementation has made.

mod peer;
mod rig;
#[rustfmt::skip]
pub mod transfers;

pub use peer::Peer;
pub use rig::{CanRig, SELECT};

/// The controller's crystal, and the bus's bit rate: both by default.
pub const CRYSTAL_HZ: u64 = 16_000_000;
pub const BITS_PER_SECOND: u64 = 1_000_000;

/// The frames of a transfer with transfer id 0.
#[derive(Clone, Copy, Debug)]
pub struct Transfer(pub &'static [(u32, &'static [u8])]);
