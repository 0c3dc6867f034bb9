//! Whether another pack was put in.

use super::failsafe::ArmState;
use super::rest::Rest;

/// A pack whose voltage was gone for longer was taken out, in seconds. A bad contact is shorter.
const GONE_S: f32 = 1.0;

/// A cell at rest that is higher than expected by more is another cell, in volts: some 20 % of charge.
const JUMP_V: f32 = 0.15;

/// Notices that a pack was taken out, or that a fuller one stands in its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct SwapDetector {
    gone_s: f32,
    seen: bool,
    rest: Rest,
}

/// A reading at rest is compared with what is expected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Comparison {
    pub dt_s: f32,
    pub voltage_v: f32,
    pub current_a: Option<f32>,
    pub expected_resting_v: Option<f32>,
    pub cell_count: Option<u8>,
    pub arm_state: ArmState,
}

impl SwapDetector {
    pub const fn new() -> Self {
        Self {
            gone_s: 0.0,
            seen: false,
            rest: Rest::new(),
        }
    }

    /// There is no voltage.
    pub fn gone(&mut self, dt_s: f32) {
        self.gone_s += dt_s;
    }

    /// There is a voltage; whether it is another pack's.
    pub fn is_other_pack(&mut self, now: &Comparison) -> bool {
        let came_back = self.seen && self.gone_s > GONE_S;
        self.seen = true;
        self.gone_s = 0.0;
        came_back || self.has_jumped(now)
    }

    fn has_jumped(&mut self, now: &Comparison) -> bool {
        let resting_v = self.rest.update(now.dt_s, now.voltage_v, now.current_a);
        let (Some(resting_v), Some(expected_v), Some(cell_count)) =
            (resting_v, now.expected_resting_v, now.cell_count)
        else {
            return false;
        };
        now.arm_state == ArmState::Disarmed && resting_v - expected_v > JUMP_V * f32::from(cell_count)
    }
}
