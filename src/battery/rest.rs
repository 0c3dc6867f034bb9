//! Detection of rest: no load and a stable voltage.

use super::low_pass::LowPass;

/// Minimum duration of a stable voltage, in seconds.
const MIN_REST_S: f32 = 2.0;

/// Maximum change of a resting voltage, in volts: the noise after filtering.
const REST_BAND_V: f32 = 0.02;

const TIME_CONSTANT_S: f32 = 0.3;

/// Maximum current at rest, in amperes: the offset of an analog sensor and the board's own consumption.
pub(super) const RESTING_CURRENT_A: f32 = 0.5;

/// Detects rest by the duration of a stable voltage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    voltage: LowPass,
    reference_v: f32,
    duration_s: f32,
}

impl Rest {
    pub const fn new() -> Self {
        Self {
            voltage: LowPass::new(TIME_CONSTANT_S),
            reference_v: 0.0,
            duration_s: 0.0,
        }
    }

    /// Starts over with the next reading.
    pub fn reset(&mut self) {
        self.voltage.reset();
        self.duration_s = 0.0;
    }

    /// Processes a reading, and returns the voltage if the pack is at rest. A gap of [`MIN_REST_S`] between readings
    /// restarts the detection.
    pub fn update(&mut self, dt_s: f32, voltage_v: f32, current_a: Option<f32>) -> Option<f32> {
        let is_first = self.voltage.value().is_none();
        let filtered_v = self.voltage.update(dt_s, voltage_v);
        let is_loaded = current_a.is_some_and(|current_a| current_a.abs() > RESTING_CURRENT_A);
        if is_first || is_loaded || dt_s >= MIN_REST_S || (filtered_v - self.reference_v).abs() > REST_BAND_V
        {
            self.reference_v = filtered_v;
            self.duration_s = 0.0;
        } else {
            self.duration_s += dt_s;
        }
        self.voltage_v()
    }

    /// The voltage, if the pack is at rest.
    pub fn voltage_v(&self) -> Option<f32> {
        self.voltage.value().filter(|_| self.duration_s >= MIN_REST_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gap_before_the_first_reading_is_not_rest() {
        let mut rest = Rest::new();
        rest.update(0.0, 11.5, None);
        rest.reset();
        // The previous reading was 1.5 s ago, at the same voltage.
        assert_eq!(rest.update(1.5, 11.5, None), None);
        assert_eq!(rest.update(1.0, 11.5, None), None);
        assert_eq!(rest.update(1.0, 11.5, None), Some(11.5));
    }
}
