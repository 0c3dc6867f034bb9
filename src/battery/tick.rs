//! When a pack is monitored, and whether the rover is armed then.

use crate::time::Instant;

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

/// When an update happens, and whether the rover is armed then.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// When; may stall or jump.
    pub now: Instant,
    /// Whether the rover is armed.
    pub arm_state: ArmState,
}
