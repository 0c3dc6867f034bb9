//! What devices on the serial line report of themselves.

mod fuel_cell;
mod richen_power;
mod torqeedo;
mod urgency;

pub use fuel_cell::{FuelCellError, FuelCellState};
pub use richen_power::RichenPowerErrors;
pub use torqeedo::TorqeedoCondition;
pub use urgency::Urgency;
