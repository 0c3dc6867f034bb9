//! The desk without a board: a simulated rover and its pack, the clock the tasks run by, and TCP for a wire.
//!
//! The firmware's own tasks run here unchanged. The pack knows its charge; the monitor is told only what the board's
//! converter, or a device on its I2C bus, would tell it.

mod bus;
pub mod clock;
mod desk;
mod flash;
mod living_pack;
mod pack;
mod pack_input;
mod rover;
mod tcp;
mod udp;

pub use bus::{POWER_MONITOR_ADDRESS, SHUNT_OHM, SMART_BATTERY_ADDRESS, SimulatedBus};
pub use desk::run;
pub use flash::SimulatedFlash;
pub use living_pack::LivingPack;
pub use pack::{PackModel, SimulatedPack};
pub use pack_input::SimulatedPackInput;
pub use rover::SimulatedRover;
pub use tcp::{Client, Clients, TcpReceiver, TcpTransmitter};
pub use udp::{UdpReceiver, UdpTransmitter, UdpWire};
