//! Internal resistance, learnt from load steps.

use super::low_pass::{LowPass, share_of_step};

/// Changes faster than this are smoothed: noise, and sensors whose voltage follows the current by a sample.
const FAST_TIME_CONSTANT_S: f32 = 0.3;

/// Changes slower than this don't count: the cells are emptying, warming or relaxing, whatever the current does.
const SLOW_TIME_CONSTANT_S: f32 = 2.0;

/// Below this the current is taken not to change: what an analog sensor's noise amounts to.
const SMALLEST_STEP_A: f32 = 0.3;

/// Below this share of the current it is taken not to change: a load that swells and ebbs within seconds is answered by
/// the slow part of the sag as well.
const SMALLEST_STEP: f32 = 0.15;

/// Half of what was learnt is forgotten after some 40 s of changing load: the resistance follows temperature and charge.
const MEMORY_S: f32 = 60.0;

/// What has to be learnt before the resistance is told: a step of 1 A, or four of half an ampere. With 8 mV of noise the
/// standard deviation is 4 mΩ then.
const ENOUGH_A2S: f32 = 0.25;

/// Learns the resistance by comparing how voltage and current change.
///
/// Both pass through the same filters, which keep what changes within 0.3 to 2 s. What is left of the voltage is what is
/// left of the current, times the resistance; the least-squares slope weighs large steps most. While the current does
/// not change nothing is learnt: a voltage that falls by itself is no resistance.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResistanceEstimator {
    voltage: BandPass,
    current: BandPass,
    /// ∫ −dV·dI dt
    voltage_by_current: f32,
    /// ∫ dI² dt
    current_squared: f32,
}

#[derive(Clone, Copy, Debug)]
struct BandPass {
    fast: LowPass,
    slow: LowPass,
}

impl BandPass {
    const fn new() -> Self {
        Self {
            fast: LowPass::new(FAST_TIME_CONSTANT_S),
            slow: LowPass::new(SLOW_TIME_CONSTANT_S),
        }
    }

    fn update(&mut self, dt_s: f32, input: f32) -> f32 {
        self.fast.update(dt_s, input) - self.slow.update(dt_s, input)
    }
}

impl ResistanceEstimator {
    pub const fn new() -> Self {
        Self {
            voltage: BandPass::new(),
            current: BandPass::new(),
            voltage_by_current: 0.0,
            current_squared: 0.0,
        }
    }

    /// Takes a reading `dt_s` seconds after the one before.
    pub fn update(&mut self, dt_s: f32, voltage_v: f32, current_a: f32) {
        let voltage_step_v = self.voltage.update(dt_s, voltage_v);
        let current_step_a = self.current.update(dt_s, current_a);
        let load_a = self.current.slow.value().unwrap_or(current_a);
        if current_step_a.abs() < SMALLEST_STEP_A.max(SMALLEST_STEP * load_a.abs()) {
            return;
        }
        let kept = 1.0 - share_of_step(dt_s, MEMORY_S);
        self.voltage_by_current = self.voltage_by_current * kept - voltage_step_v * current_step_a * dt_s;
        self.current_squared = self.current_squared * kept + current_step_a * current_step_a * dt_s;
    }

    /// The resistance of the pack in ohms, once it is known.
    pub fn resistance_ohm(&self) -> Option<f32> {
        if self.current_squared < ENOUGH_A2S {
            return None;
        }
        let resistance_ohm = self.voltage_by_current / self.current_squared;
        (resistance_ohm.is_finite() && resistance_ohm > 0.0).then_some(resistance_ohm)
    }
}
