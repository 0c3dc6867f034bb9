//! One tick of a pack, as faults, failsafe and charge state are evaluated by it.

use crate::Tick;
use crate::time::Instant;

/// The inputs of one tick's evaluation, beside the state that it left.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    pub tick: Tick,
    /// Since the tick before, in microseconds (saturating).
    pub dt_us: u32,
    /// Since the tick before, in seconds.
    pub dt_s: f32,
    /// Whether the state shows this tick's reading: not if the read failed or no pack is connected.
    pub is_fresh: bool,
    pub last_healthy: Option<Instant>,
    /// The latest voltage while connected, in volts.
    pub last_voltage_v: Option<f32>,
    /// Whether the detected cells may be fewer than there are.
    pub cells_are_doubtful: bool,
    /// The voltage at rest, in volts, if the pack is at rest.
    pub resting_v: Option<f32>,
    /// By how much the highest resting voltage of a sum's packs exceeds the lowest, relative to it, if they are at rest.
    pub members_spread: Option<f32>,
}

impl Basis {
    /// Whether there was a healthy reading. A pack may be measured and yet unhealthy: one whose gauge has timed out.
    pub fn is_healthy(&self) -> bool {
        self.is_fresh && self.last_healthy == Some(self.tick.now)
    }
}
