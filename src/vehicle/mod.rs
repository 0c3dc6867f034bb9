//! The vehicle state machine: arming, modes, control inputs, failsafes, and the outputs to motors, lamps and buzzer.

mod action;
mod controls;
mod event;
mod indication;
mod mode;
mod motor;
mod ramp;
mod restart;
mod settings;
mod timed_input;
#[expect(
    clippy::module_inception,
    reason = "the file is named after its type, the folder after the subject"
)]
mod vehicle;

pub use action::FailsafeAction;
pub use controls::{Stick, StickInput};
pub use event::VehicleEvent;
pub use indication::{Colour, Indication, Indicators, Tone};
pub use mode::Mode;
pub use motor::{MotorDrive, Motors, SideDrives};
pub use restart::Restart;
pub use settings::{VehicleSettings, control_timeout_us};
pub use vehicle::{Alert, ArmingRefused, Fitness, ModeRefused, Vehicle, VehicleStatus};
