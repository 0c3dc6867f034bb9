//! What the rover does on its own and people should know.

use core::fmt;

use super::FailsafeAction;

/// Something the rover does on its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum VehicleEvent {
    /// A failsafe's action takes a position, so the rover holds instead.
    NeedsPosition(FailsafeAction),
    /// A failsafe disarmed it for good.
    Terminated,
    /// Control inputs stay away: it holds.
    ControlsSilent,
    /// No ground station is heard any more: it holds.
    GroundStationsSilent,
}

impl fmt::Display for VehicleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NeedsPosition(action) => write!(f, "{action} needs a position: Hold"),
            Self::Terminated => f.write_str("Terminated by battery failsafe"),
            Self::ControlsSilent => f.write_str("Radio Failsafe: Hold"),
            Self::GroundStationsSilent => f.write_str("GCS Failsafe: Hold"),
        }
    }
}
