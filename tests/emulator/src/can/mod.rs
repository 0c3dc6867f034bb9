//! A CAN bus in emulated time (Bosch, CAN Specification 2.0, September 1991): nodes, arbitration by identifier, the length of
//! every frame with its stuff bits, acknowledgement, error frames, error counters, bus-off and the way back.
//!
//! Modelled frame by frame, not bit by bit: an error is noticed by all nodes at the same bit, in the middle of a frame; an error
//! frame has the shortest length. Left out: remote and overload frames, resynchronisation, dominant bits that last longer than
//! a flag except on a wire that is stuck.

mod bus;
mod confinement;
mod frame;
mod node;
mod station;
#[cfg(test)]
mod tests;
mod traffic;

pub use bus::{CanBus, CanOutcome, CanRecord, CanWires, SharedCanBus};
pub use confinement::{Confinement, ErrorState};
pub use frame::{CanFrame, CanId};
pub use node::CanNode;
pub use station::Station;
pub use traffic::Traffic;

use super::clock::{CLK_SYS_HZ, Cycle};

/// The length of a bit.
pub const fn bit_time(bits_per_second: u64) -> Cycle {
    CLK_SYS_HZ / bits_per_second
}
