//! Internal resistance, learnt from load steps.

use super::low_pass::{LowPass, Pace};

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

/// And for how long, in seconds: in the middle of a step, a voltage that is a little late shows too little.
const ENOUGH_S: f32 = 1.5;

/// Learns the resistance by comparing how voltage and current change.
///
/// Both pass through the same filters, which keep what changes within 0.3 to 2 s. What is left of the voltage is what is
/// left of the current, times the resistance; the least-squares slope weighs large steps most. While the current does
/// not change nothing is learnt: a voltage that falls by itself is no resistance.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResistanceEstimator {
    voltage: BandPass,
    current: BandPass,
    memory: Pace,
    /// ∫ −dV·dI dt
    voltage_by_current: f32,
    /// ∫ dI² dt
    current_squared: f32,
    /// For how long the current has changed, up to [`ENOUGH_S`].
    changing_s: f32,
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
            memory: Pace::new(MEMORY_S),
            voltage_by_current: 0.0,
            current_squared: 0.0,
            changing_s: 0.0,
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
        self.changing_s = (self.changing_s + dt_s).min(ENOUGH_S);
        let kept = 1.0 - self.memory.share_of_step(dt_s);
        self.voltage_by_current = self.voltage_by_current * kept - voltage_step_v * current_step_a * dt_s;
        self.current_squared = self.current_squared * kept + current_step_a * current_step_a * dt_s;
    }

    /// The resistance of the pack in ohms, once it is known.
    pub fn resistance_ohm(&self) -> Option<f32> {
        if self.current_squared < ENOUGH_A2S || self.changing_s < ENOUGH_S {
            return None;
        }
        let resistance_ohm = self.voltage_by_current / self.current_squared;
        (resistance_ohm.is_finite() && resistance_ohm > 0.0).then_some(resistance_ohm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f32 = 10.0;

    /// Feeds `seconds` of readings whose voltage and current follow `at(t_s)`, and returns what was learnt.
    fn learnt_from(seconds: f32, rate_hz: f32, at: impl Fn(f32) -> (f32, f32)) -> Option<f32> {
        let mut estimator = ResistanceEstimator::new();
        for sample in 0..(seconds * rate_hz) as u32 {
            let (voltage_v, current_a) = at(sample as f32 / rate_hz);
            estimator.update(1.0 / rate_hz, voltage_v, current_a);
        }
        estimator.resistance_ohm()
    }

    fn square(t_s: f32, low_a: f32, high_a: f32) -> f32 {
        if ((t_s / 5.0) as u32).is_multiple_of(2) {
            low_a
        } else {
            high_a
        }
    }

    #[track_caller]
    fn assert_close(resistance_ohm: Option<f32>, expected_ohm: f32, share: f32) {
        let resistance_ohm = resistance_ohm.expect("a resistance");
        assert!(
            (resistance_ohm / expected_ohm - 1.0).abs() < share,
            "{resistance_ohm}"
        );
    }

    #[test]
    fn one_step_shows_it_at_every_rate() {
        for rate_hz in [5.0, 10.0, 50.0] {
            let learnt = learnt_from(7.0, rate_hz, |t_s| {
                let current_a = square(t_s, 1.0, 3.0);
                (12.0 - 0.05 * current_a, current_a)
            });
            assert_close(learnt, 0.05, 0.01);
        }
    }

    #[test]
    fn the_noise_of_the_board_is_averaged_out() {
        // A triangle of ± 14 mV has 8 mV rms.
        let noise_v = |t_s: f32| 0.014 * (((t_s * RATE_HZ * 7.3) % 2.0) - 1.0);
        let learnt = learnt_from(60.0, RATE_HZ, |t_s| {
            let current_a = square(t_s, 0.3, 1.8);
            (7.9 - 0.15 * current_a + noise_v(t_s), current_a)
        });
        assert_close(learnt, 0.15, 0.1);
    }

    #[test]
    fn a_voltage_that_falls_under_a_constant_load_is_no_resistance() {
        assert_eq!(
            learnt_from(60.0, RATE_HZ, |t_s| (if t_s < 20.0 { 11.1 } else { 9.8 }, 5.0)),
            None
        );
        let learnt = learnt_from(60.0, RATE_HZ, |t_s| {
            let current_a = if t_s < 20.0 { square(t_s, 2.0, 6.0) } else { 6.0 };
            let fall_v = 0.1 * (t_s - 20.0).max(0.0);
            (12.0 - 0.04 * current_a - fall_v, current_a)
        });
        assert_close(learnt, 0.04, 0.05);
    }

    #[test]
    fn a_voltage_one_sample_late_shows_the_same() {
        let learnt = learnt_from(60.0, RATE_HZ, |t_s| {
            (12.0 - 0.05 * square(t_s - 0.1, 1.0, 11.0), square(t_s, 1.0, 11.0))
        });
        assert_close(learnt, 0.05, 0.1);
    }

    #[test]
    fn a_resistance_that_changes_is_followed() {
        let learnt = learnt_from(300.0, RATE_HZ, |t_s| {
            let current_a = square(t_s, 1.0, 6.0);
            let resistance_ohm = if t_s < 150.0 { 0.05 } else { 0.1 };
            (12.0 - resistance_ohm * current_a, current_a)
        });
        assert_close(learnt, 0.1, 0.1);
    }

    #[test]
    fn a_voltage_that_rises_with_the_load_is_not_believed() {
        assert_eq!(
            learnt_from(60.0, RATE_HZ, |t_s| {
                let current_a = square(t_s, 1.0, 6.0);
                (11.0 + 0.05 * current_a, current_a)
            }),
            None
        );
    }
}
