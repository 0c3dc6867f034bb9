//! Motor outputs and their mixing, and the slew rate limiter of the throttle.

use crate::time::Instant;

/// Output to a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum MotorDrive {
    /// Rolls freely: both inputs of the H bridge low.
    #[default]
    Coast,
    /// Shorted: both inputs of the H bridge high.
    Brake,
    /// Driven at this duty, from −1 (full reverse) to 1 (full ahead).
    Turn(f32),
}

/// Outputs of both sides; the motors of one side turn alike (skid steering).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct SideDrives {
    /// Left motors.
    pub left: MotorDrive,
    /// Right motors.
    pub right: MotorDrive,
}

impl SideDrives {
    /// All motors coast.
    pub const COAST: Self = Self {
        left: MotorDrive::Coast,
        right: MotorDrive::Coast,
    };

    /// All motors brake.
    pub const BRAKE: Self = Self {
        left: MotorDrive::Brake,
        right: MotorDrive::Brake,
    };
}

/// Minimum duty; below it a motor only hums.
const MIN_DUTY: f32 = 0.01;

impl MotorDrive {
    /// Turns at this duty (−1 to 1), or coasts below [`MIN_DUTY`]: a neutral stick is not a request to brake.
    fn turn(duty: f32) -> Self {
        if duty.abs() < MIN_DUTY {
            Self::Coast
        } else {
            Self::Turn(duty)
        }
    }

    /// Share of its full power, from 0 to 1.
    fn effort(self) -> f32 {
        match self {
            Self::Coast | Self::Brake => 0.0,
            Self::Turn(duty) => duty.abs(),
        }
    }
}

impl SideDrives {
    /// Skid-steering mixer; both inputs from −1 to 1. Saturation of one side scales both, which preserves the
    /// curvature.
    pub(super) fn mixed(throttle: f32, steering: f32) -> Self {
        let (left, right) = (throttle + steering, throttle - steering);
        let scale = left.abs().max(right.abs()).max(1.0);
        Self {
            left: MotorDrive::turn(left / scale),
            right: MotorDrive::turn(right / scale),
        }
    }

    /// Mean share of full power, from 0 to 1.
    pub(super) fn effort(self) -> f32 {
        (self.left.effort() + self.right.effort()) / 2.0
    }
}

/// The rover's motors.
pub trait Motors {
    /// Applies `drives` from now on.
    fn drive(&mut self, drives: SideDrives);
}

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
    use MotorDrive::{Coast, Turn};

    use super::*;
    use crate::time::at_us;

    #[test]
    fn mixer_scales_both_sides_at_saturation() {
        for (throttle, steering, left, right) in [
            (0.0, 0.0, Coast, Coast),
            (0.5, 0.0, Turn(0.5), Turn(0.5)),
            (0.0, 0.5, Turn(0.5), Turn(-0.5)),
            (0.5, 0.5, Turn(1.0), Coast),
            (1.0, 1.0, Turn(1.0), Coast),
            (-1.0, 0.5, Turn(-1.0 / 3.0), Turn(-1.0)),
            (0.009, 0.0, Coast, Coast),
        ] {
            assert_eq!(
                SideDrives::mixed(throttle, steering),
                SideDrives { left, right },
                "{throttle} {steering}"
            );
        }
    }

    #[test]
    fn effort_is_the_mean_of_both_sides() {
        assert_eq!(SideDrives::mixed(0.0, 1.0).effort(), 1.0);
        assert_eq!(SideDrives::mixed(1.0, 1.0).effort(), 0.5);
        assert_eq!(SideDrives::BRAKE.effort(), 0.0);
    }

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
