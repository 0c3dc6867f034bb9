//! Smoothing that does not depend on how often it is sampled.

/// A first-order low-pass filter over time. It starts with the first value it is given.
#[derive(Clone, Copy, Debug)]
pub(super) struct LowPass {
    pace: Pace,
    value: Option<f32>,
}

impl LowPass {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            pace: Pace::new(time_constant_s),
            value: None,
        }
    }

    pub fn value(&self) -> Option<f32> {
        self.value
    }

    /// The next value is the first one.
    pub fn restart(&mut self) {
        self.value = None;
    }

    /// Takes a value that has lasted for `dt_s` seconds, and returns the smoothed one.
    pub fn update(&mut self, dt_s: f32, input: f32) -> f32 {
        let share = self.pace.share_of_step(dt_s);
        let value = self.value.map_or(input, |value| value + (input - value) * share);
        self.value = Some(value);
        value
    }
}

/// A low-pass filter that is the plain mean of what it has seen until that is as long as its time constant.
#[derive(Clone, Copy, Debug)]
pub(super) struct WarmingLowPass {
    filter: LowPass,
    time_constant_s: f32,
    age_s: f32,
}

impl WarmingLowPass {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            filter: LowPass::new(time_constant_s),
            time_constant_s,
            age_s: 0.0,
        }
    }

    /// As if `value` had lasted for long.
    pub fn settle(&mut self, value: f32) {
        self.filter.value = Some(value);
        self.age_s = self.time_constant_s;
    }

    pub fn value(&self) -> Option<f32> {
        self.filter.value
    }

    /// Takes a value that has lasted for `dt_s` seconds.
    pub fn update(&mut self, dt_s: f32, input: f32) {
        match self.filter.value {
            Some(mean) if self.age_s < self.time_constant_s => {
                self.age_s += dt_s;
                let share = if dt_s > 0.0 {
                    (dt_s / self.age_s).min(1.0)
                } else {
                    0.0
                };
                self.filter.value = Some(mean + (input - mean) * share);
            }
            _ => {
                self.filter.update(dt_s, input);
            }
        }
    }
}

/// How much of a step a filter takes up in an interval.
///
/// Readings come at a steady pace, so the answer is nearly always the one before. It is kept: without floating point in
/// hardware, a division takes as long as everything else a filter does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    time_constant_s: f32,
    dt_s: f32,
    share: f32,
}

impl Pace {
    pub const fn new(time_constant_s: f32) -> Self {
        Self {
            time_constant_s,
            dt_s: 0.0,
            share: 0.0,
        }
    }

    /// 1 − exp(−dt/τ) as the fraction 2x / (2 + x), which is right to 0.3 % up to a third of the time constant.
    pub fn share_of_step(&mut self, dt_s: f32) -> f32 {
        if dt_s != self.dt_s {
            let x = dt_s / self.time_constant_s;
            self.dt_s = dt_s;
            self.share = (2.0 * x / (2.0 + x)).min(1.0);
        }
        self.share
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
