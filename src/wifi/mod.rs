//! Wi-Fi.

mod packet;

pub use packet::{PacketFault, check_packet};
