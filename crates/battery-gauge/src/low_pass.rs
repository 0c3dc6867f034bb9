//! Low-pass filters whose response does not depend on the sample rate.

/// First-order low-pass filter, initialised with its first input.
#[derive(Clone, Copy, Debug)]
pub struct LowPass {
    gain: FilterGain,
    value: Option<f32>,
}

impl LowPass {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            gain: FilterGain::new(time_constant_s),
            value: None,
        }
    }

    pub fn value(&self) -> Option<f32> {
        self.value
    }

    /// The next input initialises the filter again.
    pub fn reset(&mut self) {
        self.value = None;
    }

    /// Processes an input that lasted for `dt_s` seconds, and returns the output.
    pub fn update(&mut self, dt_s: f32, input: f32) -> f32 {
        let alpha = self.gain.alpha(dt_s);
        let value = self.value.map_or(input, |value| value + (input - value) * alpha);
        self.value = Some(value);
        value
    }
}

/// Low-pass filter that is the running mean of its inputs until these span its time constant.
#[derive(Clone, Copy, Debug)]
pub struct MeanThenLowPass {
    filter: LowPass,
    time_constant_s: f32,
    age_s: f32,
}

impl MeanThenLowPass {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            filter: LowPass::new(time_constant_s),
            time_constant_s,
            age_s: 0.0,
        }
    }

    /// Initialises the filter in steady state at `value`.
    pub fn initialise(&mut self, value: f32) {
        self.filter.value = Some(value);
        self.age_s = self.time_constant_s;
    }

    pub fn value(&self) -> Option<f32> {
        self.filter.value
    }

    /// The output, once its inputs span the time constant.
    pub fn settled(&self) -> Option<f32> {
        self.filter.value.filter(|_| self.age_s >= self.time_constant_s)
    }

    /// Processes an input that lasted for `dt_s` seconds.
    pub fn update(&mut self, dt_s: f32, input: f32) {
        match self.filter.value {
            Some(mean) if self.age_s < self.time_constant_s => {
                self.age_s += dt_s;
                let alpha = if dt_s > 0.0 {
                    (dt_s / self.age_s).min(1.0)
                } else {
                    0.0
                };
                self.filter.value = Some(mean + (input - mean) * alpha);
            }
            _ => {
                self.filter.update(dt_s, input);
            }
        }
    }
}

/// Bits of a float by which equal intervals differ: between 1/256 and 1/128 of it.
const SAME_INTERVAL: u32 = 1 << 15;

/// Gain of a first-order filter for a sample interval.
///
/// The gain is cached, since intervals are nearly equal: without an FPU a division takes as long as the rest of the filter.
#[derive(Clone, Copy, Debug)]
pub struct FilterGain {
    time_constant_s: f32,
    dt_s: f32,
    alpha: f32,
}

impl FilterGain {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            time_constant_s,
            dt_s: 0.0,
            alpha: 0.0,
        }
    }

    /// 1 − exp(−dt/τ), approximated by 2x / (2 + x): within 0.3 % up to a third of the time constant. Intervals that
    /// differ by less than a percent have the same gain: those between readings vary by microseconds.
    pub fn alpha(&mut self, dt_s: f32) -> f32 {
        // Of positive floats the bits have the same order, and comparing these takes no call.
        if dt_s.to_bits().abs_diff(self.dt_s.to_bits()) > SAME_INTERVAL {
            let x = dt_s / self.time_constant_s;
            self.dt_s = dt_s;
            self.alpha = (2.0 * x / (2.0 + x)).min(1.0);
        }
        self.alpha
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after_one_second(rate_hz: usize) -> f32 {
        let mut filter = LowPass::new(0.5);
        filter.update(0.0, 0.0);
        for _ in 0..rate_hz {
            filter.update(1.0 / rate_hz as f32, 1.0);
        }
        filter.value().unwrap()
    }

    #[test]
    fn step_response_does_not_depend_on_the_sample_rate() {
        let expected = 1.0 - (-2.0f32).exp();
        for rate_hz in [5, 10, 50, 1000] {
            let value = after_one_second(rate_hz);
            assert!((value - expected).abs() < 0.005, "{rate_hz} Hz: {value}");
        }
    }

    #[test]
    fn long_interval_takes_the_new_value() {
        let mut filter = LowPass::new(0.5);
        filter.update(0.0, 0.0);
        assert_eq!(filter.update(1e9, 7.0), 7.0);
    }
}
