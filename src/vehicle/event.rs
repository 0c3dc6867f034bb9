//! Vehicle events that are announced.

use core::fmt;

use super::FailsafeAction;

/// A state change without an operator's request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum VehicleEvent {
    /// A failsafe action needs a position; the rover enters Hold instead.
    NeedsPosition(FailsafeAction),
    /// A failsafe has terminated the drive: disarmed and locked.
    Terminated,
    /// Control inputs have timed out: Hold.
    ControlsTimedOut,
    /// Heartbeats of ground stations have timed out: Hold.
    GroundStationsTimedOut,
}

impl fmt::Display for VehicleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NeedsPosition(action) => write!(f, "{action} needs a position: Hold"),
            Self::Terminated => f.write_str("Terminated by battery failsafe"),
            Self::ControlsTimedOut => f.write_str("Radio Failsafe: Hold"),
            Self::GroundStationsTimedOut => f.write_str("GCS Failsafe: Hold"),
        }
    }
}
