//! When a pack is monitored.

use super::ArmState;
use crate::time::Instant;

/// When an update happens, and whether the rover is armed then.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// When; may stall or jump.
    pub now: Instant,
    /// Whether the rover is armed.
    pub arm_state: ArmState,
}
