//! Stories that the simulator plays without a ground station: what happens to the rover and its pack, and when.
//!
//! Each file is one [`Scenario`], a table. What its driver does goes to the vehicle as MAVLink messages; only what hands do to
//! a pack is done to the simulated pack itself.

mod cold;
mod drain;
mod loose_wire;
mod play;
mod registry;
mod story;
mod swap;

pub(super) use play::Player;
pub use story::{Action, Plugged, Scenario, Sight, Step};
