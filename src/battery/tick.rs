//! When a pack is monitored.

use super::ArmState;

/// When an update happens, and whether the rover is armed then.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// Microseconds since an arbitrary epoch; may stall or jump.
    pub now_us: u64,
    /// Whether the rover is armed.
    pub arm_state: ArmState,
}
