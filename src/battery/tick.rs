//! When a pack is monitored, and whether the rover is armed then.

use crate::time::Instant;
use crate::vehicle::ArmState;

/// When an update happens, and whether the rover is armed then.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// When; may stall or jump.
    pub now: Instant,
    /// Whether the rover is armed.
    pub arm_state: ArmState,
}
