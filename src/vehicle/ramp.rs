//! Slew rate limiter of the throttle.

use crate::time::Instant;

/// Slew rate limiter.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ramp {
    value: f32,
    last: Option<Instant>,
}

impl Ramp {
    /// The output, from −1 to 1.
    pub fn value(&self) -> f32 {
        self.value
    }

    /// Moves towards `target` (−1 to 1) at up to `rate_per_s`; `None` is unlimited.
    pub fn follow(&mut self, now: Instant, target: f32, rate_per_s: Option<f32>) {
        let elapsed_us = now.us_since(self.last.replace(now).unwrap_or(now));
        let change = target - self.value;
        self.value += match rate_per_s {
            Some(rate_per_s) => {
                let max_change = rate_per_s * elapsed_us as f32 * 1e-6;
                change.max(-max_change).min(max_change)
            }
            None => change,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    fn rate_is_limited_in_both_directions() {
        let mut ramp = Ramp::default();
        let mut after = |us, target| {
            ramp.follow(at_us(us), target, Some(1.0));
            ramp.value()
        };
        assert_eq!(after(5_000_000, 1.0), 0.0);
        assert_eq!(after(5_500_000, 1.0), 0.5);
        assert_eq!(after(9_000_000, 1.0), 1.0);
        assert_eq!(after(9_500_000, -1.0), 0.5);
        assert_eq!(after(9_600_000, 0.5), 0.5);
    }

    #[test]
    fn without_a_limit_the_output_follows_at_once() {
        let mut ramp = Ramp::default();
        ramp.follow(Instant::EPOCH, -1.0, None);
        assert_eq!(ramp.value(), -1.0);
    }
}
