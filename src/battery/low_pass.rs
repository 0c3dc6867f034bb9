//! Smoothing that does not depend on how often it is sampled.

/// A first-order low-pass filter over time. It starts with the first value it is given.
#[derive(Clone, Copy, Debug)]
pub(super) struct LowPass {
    time_constant_s: f32,
    value: Option<f32>,
}

impl LowPass {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            time_constant_s,
            value: None,
        }
    }

    pub fn value(&self) -> Option<f32> {
        self.value
    }

    /// Takes a value that has lasted for `dt_s` seconds, and returns the smoothed one.
    pub fn update(&mut self, dt_s: f32, input: f32) -> f32 {
        let value = match self.value {
            None => input,
            Some(value) => value + (input - value) * share_of_step(dt_s, self.time_constant_s),
        };
        self.value = Some(value);
        value
    }
}

/// A low-pass filter that is the plain mean of what it has seen until that is as long as its time constant.
#[derive(Clone, Copy, Debug)]
pub(super) struct WarmingLowPass {
    time_constant_s: f32,
    age_s: f32,
    value: Option<f32>,
}

impl WarmingLowPass {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            time_constant_s,
            age_s: 0.0,
            value: None,
        }
    }

    /// As if `value` had lasted for long.
    pub fn settle(&mut self, value: f32) {
        self.value = Some(value);
        self.age_s = self.time_constant_s;
    }

    pub fn value(&self) -> Option<f32> {
        self.value
    }

    /// Takes a value that has lasted for `dt_s` seconds.
    pub fn update(&mut self, dt_s: f32, input: f32) {
        self.age_s = (self.age_s + dt_s).min(self.time_constant_s);
        let share = match self.age_s {
            age_s if age_s < self.time_constant_s => (dt_s / age_s).min(1.0),
            _ => share_of_step(dt_s, self.time_constant_s),
        };
        self.value = Some(match self.value {
            Some(value) if dt_s > 0.0 => value + (input - value) * share,
            Some(value) => value,
            None => input,
        });
    }
}

/// 1 − exp(−dt/τ) as the fraction 2x / (2 + x), which is right to 0.3 % up to a third of the time constant and costs a
/// tenth of an exponential on a processor without floating point.
pub(super) fn share_of_step(dt_s: f32, time_constant_s: f32) -> f32 {
    let x = dt_s / time_constant_s;
    (2.0 * x / (2.0 + x)).min(1.0)
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
    fn a_step_is_followed_alike_at_every_rate() {
        let expected = 1.0 - (-2.0f32).exp();
        for rate_hz in [5, 10, 50, 1000] {
            let value = after_one_second(rate_hz);
            assert!((value - expected).abs() < 0.005, "{rate_hz} Hz: {value}");
        }
    }

    #[test]
    fn a_long_pause_takes_the_new_value() {
        let mut filter = LowPass::new(0.5);
        filter.update(0.0, 0.0);
        assert_eq!(filter.update(1e9, 7.0), 7.0);
    }
}
