//! The rover: whether it is armed, in which mode, what a failsafe does, and what its motors and lamps are told.

mod action;
mod controls;
mod event;
mod indication;
mod mode;
mod motor;
mod ramp;
mod rover;
mod settings;
mod timed_input;

pub use action::FailsafeAction;
pub use controls::{Lever, LeverName};
pub use event::VehicleEvent;
pub use indication::{Colour, Indication, Indicators, Tone};
pub use mode::Mode;
pub use motor::{MotorDrive, Motors, SideDrives};
pub use rover::{Alert, ArmingRefused, ModeRefused, Vehicle, VehicleStatus};
pub use settings::VehicleSettings;
