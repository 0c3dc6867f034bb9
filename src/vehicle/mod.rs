//! The vehicle state machine: arming, modes, control inputs, failsafes, and the outputs to motors, lamps and buzzer.

mod controls;
mod driver;
mod failsafe;
mod indication;
mod motor;
mod power_limit;
mod settings;
mod status;
mod timed_input;
#[expect(
    clippy::module_inception,
    reason = "the file is named after its type, the folder after the subject"
)]
mod vehicle;

pub use battery_gauge::FailsafeLevel;
pub use controls::{Stick, StickInput};
pub use driver::{AnotherDrives, ControlMessage, DriverId, Presence};
pub use failsafe::{FailsafeAction, VehicleEvent};
pub use indication::{BatteryAlert, Colour, Indication, Indicators, Tone};
pub use motor::{MotorDrive, Motors, SideDrives};
pub use power_limit::PowerLimit;
pub use settings::{VehicleSettings, control_timeout_us};
pub use status::{Alert, ArmState, Fitness, Mode, Restart, VehicleStatus};
pub use vehicle::{ArmingRefused, ModeRefused, Vehicle};
