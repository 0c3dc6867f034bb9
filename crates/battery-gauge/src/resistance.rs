//! Internal resistance, estimated from load steps.

use crate::low_pass::FilterGain;

/// Upper corner of the band-pass filter, in seconds: below it are noise, and a delay of one sample between the sensors.
const FAST_TIME_CONSTANT_S: f32 = 0.3;

/// Lower corner of the band-pass filter, in seconds: above it are discharge, warming and relaxation of the cells.
const SLOW_TIME_CONSTANT_S: f32 = 2.0;

/// Minimum change of the current, in amperes: above the noise of an analog sensor.
const MIN_STEP_A: f32 = 0.3;

/// Minimum change of the current, relative to the load: a load that changes over seconds also drives the slow part of
/// the sag.
const MIN_RELATIVE_STEP: f32 = 0.15;

/// Time constant of forgetting, in seconds of changing load: the resistance depends on temperature and charge.
const FORGETTING_TIME_CONSTANT_S: f32 = 60.0;

/// Minimum excitation before the resistance is known: one step of 1 A or four of 0.5 A. With 8 mV of noise its standard
/// deviation is 4 mΩ then.
const MIN_EXCITATION_A2S: f32 = 0.25;

/// Minimum duration of excitation, in seconds: within a step, a delayed voltage shows too small a resistance.
const MIN_EXCITATION_S: f32 = 1.5;

/// Excitation after which a voltage that falls as the current falls is that of a reversed sensor, and the least resistance that it
/// shows then: of a sound one both are noise.
const REVERSED_EXCITATION_A2S: f32 = 10.0 * MIN_EXCITATION_A2S;
const REVERSED_OHM: f32 = 0.004;

/// Readings up to this interval show a step, in seconds.
const MAX_INTERVAL_S: f32 = 15.0;

/// Estimates the resistance by least squares over changes of voltage and current.
///
/// Both pass the same band-pass filter, 0.3 to 2 s; the resistance is the slope of the filtered voltage over the
/// filtered current. The estimate is held while the current does not change: a voltage that falls under constant load
/// is not a resistance.
#[derive(Clone, Copy, Debug)]
pub struct ResistanceEstimator {
    fast: FilterGain,
    slow: FilterGain,
    /// Of voltage and current, from the first reading on.
    bands: Option<(BandPass, BandPass)>,
    forgetting: FilterGain,
    /// Since the resistance was brought up to date.
    recent: Excitation,
    /// All of it, of which what is older counts less; its duration is at most [`MIN_EXCITATION_S`].
    kept: Excitation,
    /// The resistance by these, in ohms, once known.
    resistance_ohm: Option<f32>,
}

/// Integrals over the time in which the current changes.
#[derive(Clone, Copy, Debug)]
struct Excitation {
    /// ∫ −dV·dI dt
    voltage_by_current: f32,
    /// ∫ dI² dt
    current_squared: f32,
    duration_s: f32,
}

/// Two low-pass filters, of which the difference is taken.
#[derive(Clone, Copy, Debug)]
struct BandPass {
    fast: f32,
    slow: f32,
}

/// The gains of these filters for a sample interval.
#[derive(Clone, Copy, Debug)]
struct Gains {
    fast: f32,
    slow: f32,
    /// A step is the difference of two readings, which are further apart than the filters reach.
    is_difference: bool,
}

impl BandPass {
    /// In steady state at the first input.
    fn start(input: f32) -> Self {
        Self {
            fast: input,
            slow: input,
        }
    }

    fn update(&mut self, gains: Gains, input: f32) -> f32 {
        let before = self.slow;
        self.fast += (input - self.fast) * gains.fast;
        self.slow += (input - self.slow) * gains.slow;
        if gains.is_difference {
            input - before
        } else {
            self.fast - self.slow
        }
    }
}

impl Excitation {
    const NONE: Self = Self {
        voltage_by_current: 0.0,
        current_squared: 0.0,
        duration_s: 0.0,
    };

    fn add(&mut self, dt_s: f32, voltage_step_v: f32, current_step_a: f32) {
        let weighted = current_step_a * dt_s;
        self.voltage_by_current -= voltage_step_v * weighted;
        self.current_squared += current_step_a * weighted;
        self.duration_s += dt_s;
    }

    /// The resistance, in ohms, once there was enough of it.
    fn slope_ohm(&self) -> Option<f32> {
        if self.current_squared < MIN_EXCITATION_A2S || self.duration_s < MIN_EXCITATION_S {
            return None;
        }
        let resistance_ohm = self.voltage_by_current / self.current_squared;
        (resistance_ohm.is_finite() && resistance_ohm > 0.0).then_some(resistance_ohm)
    }
}

impl ResistanceEstimator {
    pub const fn new() -> Self {
        Self {
            fast: FilterGain::new(FAST_TIME_CONSTANT_S),
            slow: FilterGain::new(SLOW_TIME_CONSTANT_S),
            bands: None,
            forgetting: FilterGain::new(FORGETTING_TIME_CONSTANT_S),
            recent: Excitation::NONE,
            kept: Excitation::NONE,
            resistance_ohm: None,
        }
    }

    /// Processes a reading `dt_s` seconds after the previous one.
    pub fn update(&mut self, dt_s: f32, voltage_v: f32, current_a: f32) {
        let is_sparse = dt_s > SLOW_TIME_CONSTANT_S;
        let gains = Gains {
            fast: self.fast.alpha(dt_s),
            slow: self.slow.alpha(dt_s),
            is_difference: is_sparse && dt_s <= MAX_INTERVAL_S,
        };
        let start = || (BandPass::start(voltage_v), BandPass::start(current_a));
        let (voltage, current) = self.bands.get_or_insert_with(start);
        let voltage_step_v = voltage.update(gains, voltage_v);
        let current_step_a = current.update(gains, current_a);
        let load_a = current.slow;
        let step_a = current_step_a.abs();
        if step_a < MIN_STEP_A || step_a < MIN_RELATIVE_STEP * load_a.abs() {
            return;
        }
        let dt_s = if is_sparse { SLOW_TIME_CONSTANT_S } else { dt_s };
        self.recent.add(dt_s, voltage_step_v, current_step_a);
    }

    /// Brings the resistance up to date: once a second is enough for what forgetting and a division take.
    pub fn solve(&mut self) {
        let recent = core::mem::replace(&mut self.recent, Excitation::NONE);
        if recent.duration_s > 0.0 {
            let retained = 1.0 - self.forgetting.alpha(recent.duration_s);
            self.kept = Excitation {
                voltage_by_current: self.kept.voltage_by_current * retained + recent.voltage_by_current,
                current_squared: self.kept.current_squared * retained + recent.current_squared,
                duration_s: (self.kept.duration_s + recent.duration_s).min(MIN_EXCITATION_S),
            };
        }
        self.resistance_ohm = self.kept.slope_ohm();
    }

    /// Whether the voltage falls as the current falls.
    pub fn is_reversed(&self) -> bool {
        let Excitation {
            voltage_by_current,
            current_squared,
            ..
        } = self.kept;
        current_squared >= REVERSED_EXCITATION_A2S && voltage_by_current < -REVERSED_OHM * current_squared
    }

    /// The resistance of the pack, in ohms, once known.
    pub fn resistance_ohm(&self) -> Option<f32> {
        self.resistance_ohm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f32 = 10.0;

    /// The resistance after `seconds` of readings with voltage and current `at(t_s)`.
    fn estimated_from(seconds: f32, rate_hz: f32, at: impl Fn(f32) -> (f32, f32)) -> Option<f32> {
        let mut estimator = ResistanceEstimator::new();
        for sample in 0..(seconds * rate_hz) as u32 {
            let (voltage_v, current_a) = at(sample as f32 / rate_hz);
            estimator.update(1.0 / rate_hz, voltage_v, current_a);
            if sample as f32 % rate_hz < 1.0 {
                estimator.solve();
            }
        }
        estimator.solve();
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
    fn load_steps_suffice_at_every_sample_rate() {
        // One step each, and a reading every ten seconds.
        for (rate_hz, seconds, slower) in [
            (5.0, 7.0, 1.0),
            (10.0, 7.0, 1.0),
            (50.0, 7.0, 1.0),
            (0.1, 600.0, 20.0),
        ] {
            let estimated = estimated_from(seconds, rate_hz, |t_s| {
                let current_a = square(t_s / slower, 1.0, 3.0);
                (12.0 - 0.05 * current_a, current_a)
            });
            assert_close(estimated, 0.05, 0.01);
        }
    }

    #[test]
    fn noise_of_the_board_is_averaged_out() {
        // A triangle wave of ± 14 mV has 8 mV rms.
        let noise_v = |t_s: f32| 0.014 * (((t_s * RATE_HZ * 7.3) % 2.0) - 1.0);
        let estimated = estimated_from(60.0, RATE_HZ, |t_s| {
            let current_a = square(t_s, 0.3, 1.8);
            (7.9 - 0.15 * current_a + noise_v(t_s), current_a)
        });
        assert_close(estimated, 0.15, 0.1);
    }

    #[test]
    fn voltage_falling_at_constant_load_is_ignored() {
        for ripple_a in [0.0, 0.25] {
            let estimated = estimated_from(60.0, RATE_HZ, |t_s| {
                let voltage_v = if t_s < 20.0 { 11.1 } else { 9.8 };
                (voltage_v, 5.0 + ripple_a * (2.0 * t_s).sin())
            });
            assert_eq!(estimated, None, "{ripple_a} A");
        }
        let estimated = estimated_from(60.0, RATE_HZ, |t_s| {
            let current_a = if t_s < 20.0 { square(t_s, 2.0, 6.0) } else { 6.0 };
            let fall_v = 0.1 * (t_s - 20.0).max(0.0);
            (12.0 - 0.04 * current_a - fall_v, current_a)
        });
        assert_close(estimated, 0.04, 0.05);
    }

    #[test]
    fn voltage_delayed_by_one_sample_is_tolerated() {
        let estimated = estimated_from(60.0, RATE_HZ, |t_s| {
            (12.0 - 0.05 * square(t_s - 0.1, 1.0, 11.0), square(t_s, 1.0, 11.0))
        });
        assert_close(estimated, 0.05, 0.1);
    }

    #[test]
    fn changing_resistance_is_tracked() {
        let estimated = estimated_from(300.0, RATE_HZ, |t_s| {
            let current_a = square(t_s, 1.0, 6.0);
            let resistance_ohm = if t_s < 150.0 { 0.05 } else { 0.1 };
            (12.0 - resistance_ohm * current_a, current_a)
        });
        assert_close(estimated, 0.1, 0.1);
    }

    #[test]
    fn negative_resistance_is_rejected() {
        assert_eq!(
            estimated_from(60.0, RATE_HZ, |t_s| {
                let current_a = square(t_s, 1.0, 6.0);
                (11.0 + 0.05 * current_a, current_a)
            }),
            None
        );
    }
}
