//! The rover: what its motors and lamps are told.

mod indication;
mod motor;

pub use indication::{Colour, Indication, Indicators, Tone};
pub use motor::{MotorDrive, Motors, SideDrives};
