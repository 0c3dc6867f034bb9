//! Whether the rover is armed.

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
