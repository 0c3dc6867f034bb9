//! Simulator: a rover with its pack, the clock of the tasks, and TCP and UDP links.
//!
//! It runs the firmware's own tasks. These get only what the board's ADC and I2C bus would measure, not the true state
//! of the pack.

mod bus;
pub mod clock;
pub mod console;
mod desk;
mod fault;
mod flash;
mod log_folder;
mod pack;
mod pack_input;
mod pack_simulation;
mod rover;
mod scenario;
mod station;
mod status;
mod tcp;
#[cfg(test)]
mod test_folder;
mod udp;

pub use bus::{POWER_MONITOR_ADDRESS, SHUNT_OHM, SMART_BATTERY_ADDRESS, SimulatedBus};
pub use desk::{Setup, run};
pub use flash::SimulatedFlash;
pub use log_folder::LogFolder;
pub use pack::{PackModel, SimulatedPack};
pub use pack_input::SimulatedPackInput;
pub use pack_simulation::PackSimulation;
pub use rover::SimulatedRover;
pub use scenario::{Action, Plugged, Scenario, Sight, Step};
pub use tcp::{Client, Clients, TcpReceiver, TcpTransmitter};
pub use udp::{UdpReceiver, UdpTransmitter, UdpWire};
