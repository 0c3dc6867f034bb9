//! Simulated pack that can be sampled at any rate.

use super::replay::Sample;

const CELLS: f64 = 3.0;
const CAPACITY_AH: f64 = 2.2;
const RESISTANCE_OHM: f64 = 0.045;
const SLOW_RESISTANCE_OHM: f64 = 0.02;
const SLOW_TIME_CONSTANT_S: f64 = 8.0;

/// Small enough steps for the same load edges at every sample rate.
const STEPS_PER_SECOND: u32 = 1000;

/// Rest before the drive, disarmed.
const REST_S: f64 = 30.0;

/// Three LiPo cells with a slow and a fast part of the sag.
pub struct Pack {
    state_of_charge: f64,
    slow_sag_v: f64,
}

impl Pack {
    /// A pack at rest, with a state of charge from 0 to 1.
    pub fn at(state_of_charge: f64) -> Self {
        Self {
            state_of_charge,
            slow_sag_v: 0.0,
        }
    }

    /// Draws a current for `dt_s` seconds.
    pub fn draw(&mut self, current_a: f64, dt_s: f64) {
        self.state_of_charge -= current_a * dt_s / 3600.0 / CAPACITY_AH;
        let target_v = SLOW_RESISTANCE_OHM * current_a;
        self.slow_sag_v += (target_v - self.slow_sag_v) * (1.0 - (-dt_s / SLOW_TIME_CONSTANT_S).exp());
    }

    /// Terminal voltage under this current.
    pub fn voltage_v(&self, current_a: f64) -> f64 {
        CELLS * resting_cell_v(self.state_of_charge) - RESISTANCE_OHM * current_a - self.slow_sag_v
    }
}

/// Open-circuit voltage of a LiPo cell; smooth, and different from the monitor's curve.
fn resting_cell_v(state_of_charge: f64) -> f64 {
    let s = state_of_charge;
    3.68 + 0.19 * s + 0.33 * s.powi(4) - 0.5 * (-25.0 * s).exp()
}

/// An hour and a half on a charger of 2 A that ends at 4.2 V a cell, and ten minutes at rest, disarmed.
pub fn charging(mut pack: Pack, rate_hz: u32) -> Vec<Sample> {
    let dt_s = 1.0 / f64::from(rate_hz);
    let mut current_a = 0.0;
    let sample = |number: u32| {
        let t_s = f64::from(number) * dt_s;
        let above_v = pack.voltage_v(current_a) - CELLS * 4.2;
        current_a = match t_s {
            // The charger holds its voltage by its current.
            60.0..5_400.0 => (current_a + 5.0 * above_v - 0.1).clamp(-2.0, 0.0),
            _ => 0.0,
        };
        pack.draw(current_a, dt_s);
        Sample::measured(t_s, pack.voltage_v(current_a), current_a, false)
    };
    (0..6_000 * rate_hz).map(sample).collect()
}

/// The load of a drive, in amperes.
fn load_a(t_s: f64) -> f64 {
    if t_s < REST_S {
        return 0.2;
    }
    let swell_a = 1.5 * (t_s * 0.9).sin();
    match (t_s % 41.0) as u32 {
        0..12 => 4.0 + swell_a,
        12..19 => 12.0 + swell_a,
        19..30 => 7.0 + swell_a,
        // Standstill.
        _ => 0.2,
    }
}

/// Samples of a drive at this rate.
pub fn samples(mut pack: Pack, rate_hz: u32, duration_s: f64) -> Vec<Sample> {
    let dt_s = 1.0 / f64::from(STEPS_PER_SECOND);
    let steps = (duration_s * f64::from(STEPS_PER_SECOND)) as u32;
    let mut samples = Vec::new();
    for step in 0..=steps {
        let t_s = f64::from(step) * dt_s;
        let current_a = load_a(t_s);
        if step > 0 {
            pack.draw(current_a, dt_s);
        }
        if step % (STEPS_PER_SECOND / rate_hz) == 0 {
            let voltage_v = pack.voltage_v(current_a);
            samples.push(Sample::measured(t_s, voltage_v, current_a, t_s >= REST_S));
        }
    }
    samples
}
