//! Simulator: a rover with its pack, the clock of the tasks, and TCP and UDP links.
//!
//! It runs the firmware's own tasks. These get only what the board's ADC and I2C bus would measure, not the true state
//! of the pack.

mod browsers;
mod bus;
pub mod clock;
pub mod console;
mod desk;
mod flash;
mod fleet;
mod links;
mod log_folder;
mod pack;
mod pack_simulation;
mod rover;
mod scenario;
mod station;
mod status;
pub mod stepped;
mod tasks;
#[cfg(test)]
mod test_folder;

pub use bus::{POWER_MONITOR_ADDRESS, SHUNT_OHM, SMART_BATTERY_ADDRESS, SimulatedBus};
pub use desk::{Setup, run};
pub use flash::SimulatedFlash;
pub use fleet::{Fleet, MAX_ROVERS, Role, ready_pack};
pub use links::{Client, Clients, UdpReceiver, UdpWire};
pub use log_folder::LogFolder;
pub use pack::{PackModel, SimulatedPack};
pub use pack_simulation::{PackSimulation, SimulatedPackInput};
pub use rover::SimulatedRover;
pub use scenario::{Action, Scenario, Step};
