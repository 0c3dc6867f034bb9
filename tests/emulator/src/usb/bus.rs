//! What goes over the bus between host and device (USB 2.0, chapter 8).

use super::super::clock::{CLK_SYS_HZ, Cycle};

/// Full speed: 12 Mbit/s.
const BITS_PER_SECOND: u64 = 12_000_000;
/// What a bulk or control transaction takes besides its data: "Protocol Overhead (13 bytes)" (5.8.4).
const OVERHEAD_BYTES: u64 = 13;

/// How long a transaction with this many bytes of data takes.
pub fn transaction_time(data_bytes: usize) -> Cycle {
    (OVERHEAD_BYTES + data_bytes as u64) * 8 * CLK_SYS_HZ / BITS_PER_SECOND
}

/// An endpoint of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Endpoint {
    pub address: u8,
    pub number: u8,
}

/// What a receiver answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handshake {
    Ack,
    Nak,
    Stall,
}

/// The packet id of a data packet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Toggle {
    #[default]
    Data0,
    Data1,
}

impl Toggle {
    pub fn of(is_data1: bool) -> Self {
        if is_data1 { Self::Data1 } else { Self::Data0 }
    }

    pub fn flipped(self) -> Self {
        Self::of(self == Self::Data0)
    }
}

/// What a device sends in an IN transaction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sent {
    Data(Toggle, Vec<u8>),
    Nak,
    Stall,
}

/// What becomes of a packet that the device sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    Acknowledged,
    /// It collides with something else on the bus, and a corrupt answer comes back (RP2040-E15).
    BusError,
}
