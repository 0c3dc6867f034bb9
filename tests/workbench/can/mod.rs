//! The board's CAN controller at its pins, and peers at its bus. They send transfers that an independent implementation has made.

mod peer;
mod rig;
#[rustfmt::skip]
pub mod transfers;

pub use peer::Peer;
pub use rig::{CanRig, SELECT};

/// The frames of a transfer with transfer id 0.
#[derive(Clone, Copy, Debug)]
pub struct Transfer(pub &'static [(u32, &'static [u8])]);
