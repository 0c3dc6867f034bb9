//! The protocols, a file each.

pub(super) mod intelligent_energy;
mod kiss;
mod richen_power;

pub(super) use intelligent_energy::IntelligentEnergy;
pub use intelligent_energy::{FuelCellError, FuelCellState};
pub(super) use kiss::Kiss;
pub(super) use richen_power::RichenPower;
pub use richen_power::RichenPowerErrors;
