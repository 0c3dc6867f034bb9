//! Whether another pack was put in.

use super::failsafe::ArmState;
use super::rest::Rest;

/// A pack whose voltage was gone for longer was taken out, in seconds. A bad contact is shorter.
const GONE_S: f32 = 1.0;

/// A voltage at rest that is higher than the one before by more than this share is another pack's: 0.15 V of a lithium
/// cell, some 20 % of its charge. A charger raises it slowly.
const JUMP: f32 = 0.04;

/// Notices that a pack was taken out, or that a fuller one stands in its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct SwapDetector {
    gone_s: f32,
    rest: Rest,
    /// The latest voltage at rest, in volts.
    resting_v: Option<f32>,
    seen: bool,
}

impl SwapDetector {
    pub const fn new() -> Self {
        Self {
            gone_s: 0.0,
            rest: Rest::new(),
            resting_v: None,
            seen: false,
        }
    }

    /// There is no voltage.
    pub fn gone(&mut self, dt_s: f32) {
        self.gone_s += dt_s;
    }

    /// There is a voltage; whether it is another pack's. Nobody changes the pack of an armed rover: what comes and goes
    /// there is a bad contact, and a voltage may rest at a load.
    pub fn is_other_pack(
        &mut self,
        dt_s: f32,
        voltage_v: f32,
        current_a: Option<f32>,
        arm_state: ArmState,
    ) -> bool {
        let came_back = self.seen && self.gone_s > GONE_S && arm_state == ArmState::Disarmed;
        self.seen = true;
        self.gone_s = 0.0;
        let is_other = came_back || self.has_jumped(dt_s, voltage_v, current_a, arm_state);
        if is_other {
            self.resting_v = None;
        }
        is_other
    }

    fn has_jumped(&mut self, dt_s: f32, voltage_v: f32, current_a: Option<f32>, arm_state: ArmState) -> bool {
        let Some(resting_v) = self.rest.update(dt_s, voltage_v, current_a) else {
            return false;
        };
        if arm_state == ArmState::Armed {
            return false;
        }
        let before_v = self.resting_v.replace(resting_v);
        before_v.is_some_and(|before_v| resting_v > before_v * (1.0 + JUMP))
    }
}
