//! Whether a pack is at rest.

use super::low_pass::LowPass;

/// How long the voltage has to stay the same.
const REST_S: f32 = 2.0;

/// By how much a resting voltage may move, in volts: the noise that is left after smoothing.
const REST_BAND_V: f32 = 0.02;

const SMOOTHING_S: f32 = 0.3;

/// A current below this is none: what an analog sensor may show at rest, and the board's own consumption.
pub(super) const RESTING_CURRENT_A: f32 = 0.5;

/// Measures for how long a voltage has rested.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    smoothed: LowPass,
    /// What the voltage has stayed around since; `None` before the first reading.
    around_v: Option<f32>,
    duration_s: f32,
}

impl Rest {
    pub const fn new() -> Self {
        Self {
            smoothed: LowPass::new(SMOOTHING_S),
            around_v: None,
            duration_s: 0.0,
        }
    }

    /// As if nothing had been read yet.
    pub fn restart(&mut self) {
        self.smoothed.restart();
        self.around_v = None;
        self.duration_s = 0.0;
    }

    /// Takes a reading, and returns the voltage if it has rested for `REST_S`. What happened in a longer pause between
    /// readings is not known.
    pub fn update(&mut self, dt_s: f32, voltage_v: f32, current_a: Option<f32>) -> Option<f32> {
        let smoothed_v = self.smoothed.update(dt_s, voltage_v);
        let is_loaded = current_a.is_some_and(|current_a| current_a.abs() > RESTING_CURRENT_A);
        let is_near = |around_v: f32| (smoothed_v - around_v).abs() <= REST_BAND_V;
        if is_loaded || dt_s >= REST_S || !self.around_v.is_some_and(is_near) {
            self.around_v = Some(smoothed_v);
            self.duration_s = 0.0;
        } else {
            self.duration_s += dt_s;
        }
        self.voltage_v()
    }

    /// The voltage, if it has rested for `REST_S`.
    pub fn voltage_v(&self) -> Option<f32> {
        self.smoothed.value().filter(|_| self.duration_s >= REST_S)
    }
}
