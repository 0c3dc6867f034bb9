//! State of the vehicle, and a pending restart.

use battery_gauge::LoadState;

/// Whether the rover is armed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ArmState {
    /// The motors are off.
    #[default]
    Disarmed,
    /// The motors may turn.
    Armed,
}

impl From<ArmState> for LoadState {
    fn from(arm_state: ArmState) -> Self {
        match arm_state {
            ArmState::Disarmed => Self::Off,
            ArmState::Armed => Self::On,
        }
    }
}

/// A mode of ArduPilot's Rover. The others need a position estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum Mode {
    /// Driven by the sticks.
    Manual = 0,
    /// Brakes.
    #[default]
    Hold = 4,
}

impl Mode {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Manual, Self::Hold];

    /// ArduPilot's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Manual => "Manual",
            Self::Hold => "Hold",
        }
    }

    /// The mode with this ArduPilot Rover number.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| mode.number() == number)
    }

    /// ArduPilot Rover's number: MAVLink's `custom_mode`.
    pub fn number(self) -> u32 {
        self as u32
    }
}

/// Whether the rover may be armed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Fitness {
    /// A check has failed.
    Unfit,
    /// All checks have passed.
    #[default]
    Checked,
    /// The checks do not count.
    Forced,
}

/// Severity for ground stations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Alert {
    /// No failure.
    #[default]
    None,
    /// Control inputs or ground stations have timed out and not resumed.
    TimedOut,
    /// A failsafe has terminated the drive.
    Terminated,
}

/// Status for ground stations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VehicleStatus {
    /// The mode.
    pub mode: Mode,
    /// Whether it is armed.
    pub arm_state: ArmState,
    /// Whether it had passed its checks when it was armed last.
    pub fitness: Fitness,
    /// Severity of its failures.
    pub alert: Alert,
}

/// The program that runs after a requested restart. Of several requests the greatest counts: Mission Planner's "Force
/// Bootloader" requests the boot loader and then the firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Restart {
    /// The firmware.
    #[default]
    Firmware,
    /// The firmware, by way of a provoked processor fault: a test of the crash record.
    Fault,
    /// The chip's own boot loader, which takes another firmware by USB.
    BootLoader,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_manual_and_hold_have_a_number() {
        for number in 0..300 {
            let mode = Mode::from_number(number);
            assert_eq!(mode.is_some(), [0, 4].contains(&number), "{number}");
            assert!(mode.is_none_or(|mode| mode.number() == number));
        }
    }
}
