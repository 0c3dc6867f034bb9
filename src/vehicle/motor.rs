//! Motor outputs and their mixing, the slew rate limiter of the throttle, and the limit of a reversal.

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
    /// curvature. Duties are scaled by `share`, from 0 to 1.
    pub(super) fn mixed(throttle: f32, steering: f32, share: f32) -> Self {
        let (left, right) = (throttle + steering, throttle - steering);
        let scale = left.abs().max(right.abs()).max(1.0);
        Self {
            left: MotorDrive::turn(left / scale * share),
            right: MotorDrive::turn(right / scale * share),
        }
    }

    /// These drives, each side limited while it reverses.
    pub(super) fn limited(self, reversals: &Reversals) -> Self {
        Self {
            left: reversals.left.limit(self.left),
            right: reversals.right.limit(self.right),
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

/// Least rate towards neutral, per second: a slow start must not be a slow stop.
const LEAST_RATE_TO_NEUTRAL_PER_S: f32 = 1.0;

/// Slew rate limiter.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ramp {
    value: f32,
    last: Option<Instant>,
}

impl Ramp {
    /// The output, from −1 to 1.
    pub fn value(&self) -> f32 {
        self.value
    }

    /// Moves towards `target` (−1 to 1) at up to `rate_per_s`, and not slower than 1 per second while that is towards neutral; `None`
    /// is unlimited.
    pub fn follow(&mut self, now: Instant, target: f32, rate_per_s: Option<f32>) {
        let elapsed_us = now.us_since(self.last.replace(now).unwrap_or(now));
        let Some(rate_per_s) = rate_per_s else {
            self.value = target;
            return;
        };
        let change = target - self.value;
        let elapsed_s = elapsed_us as f32 * 1e-6;
        let max_change = if self.value * change < 0.0 {
            // On the way to a reversal it pauses at neutral until the next call.
            (rate_per_s.max(LEAST_RATE_TO_NEUTRAL_PER_S) * elapsed_s).min(self.value.abs())
        } else {
            rate_per_s * elapsed_s
        };
        self.value += change.max(-max_change).min(max_change);
    }
}

/// From the end of one way to full power the other way, in seconds.
///
/// A motor that turns generates nearly what drives it, so that a reversal at once takes up to twice its stall current, of all four
/// at the same moment. Computed for TT motors (Adafruit 3777: at 6 V 250 rpm, and stalled 0.8 kg cm and 1.5 A) with wheels of 65 mm
/// under a rover of 1 kg: its speed follows with 90 ms, so that in this ramp the voltages together, and with them the mean current,
/// never exceed those of a stall.
const REVERSAL_S: f32 = 0.25;

/// Limits of both sides.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reversals {
    left: Reversal,
    right: Reversal,
}

/// Limit of a side that turned the other way a moment ago. Towards zero there is none.
#[derive(Clone, Copy, Debug, Default)]
struct Reversal {
    is_ahead: bool,
    /// When it was to turn last, either way.
    turned_at: Option<Instant>,
    /// When it was to turn the other way last.
    reversed_at: Option<Instant>,
    /// The highest duty this way.
    most: f32,
}

impl Reversals {
    /// Follows what the sides are to do.
    pub fn follow(&mut self, now: Instant, drives: SideDrives) {
        self.left.follow(now, drives.left);
        self.right.follow(now, drives.right);
    }
}

impl Reversal {
    fn follow(&mut self, now: Instant, drive: MotorDrive) {
        let MotorDrive::Turn(duty) = drive else { return };
        let is_ahead = duty > 0.0;
        if is_ahead != self.is_ahead {
            self.is_ahead = is_ahead;
            self.reversed_at = self.turned_at;
        }
        self.turned_at = Some(now);
        let ramp = |at| now.us_since(at) as f32 * 1e-6 / REVERSAL_S;
        self.most = self.reversed_at.map_or(1.0, ramp);
    }

    fn limit(&self, drive: MotorDrive) -> MotorDrive {
        match drive {
            MotorDrive::Turn(duty) if (duty > 0.0) == self.is_ahead => {
                MotorDrive::turn(duty.max(-self.most).min(self.most))
            }
            MotorDrive::Turn(_) => MotorDrive::Coast,
            MotorDrive::Coast | MotorDrive::Brake => drive,
        }
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
                SideDrives::mixed(throttle, steering, 1.0),
                SideDrives { left, right },
                "{throttle} {steering}"
            );
        }
    }

    #[test]
    fn effort_is_the_mean_of_both_sides() {
        assert_eq!(SideDrives::mixed(0.0, 1.0, 1.0).effort(), 1.0);
        assert_eq!(SideDrives::mixed(1.0, 1.0, 1.0).effort(), 0.5);
        assert_eq!(SideDrives::BRAKE.effort(), 0.0);
    }

    #[test]
    fn a_share_scales_the_duties_of_both_sides() {
        let scaled = SideDrives::mixed(0.4, 0.6, 0.05);
        assert_eq!((scaled.left, scaled.right), (Turn(0.05), Turn(-0.2 * 0.05)));
        let slow = SideDrives::mixed(0.1, 0.0, 0.05);
        assert_eq!(slow, SideDrives::COAST, "below the least duty");
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
    fn towards_neutral_the_rate_is_at_least_full_throttle_a_second() {
        for (rate_per_s, targets) in [
            (
                0.2,
                [
                    (0.5, 0.5),
                    (-1.0, 0.0),
                    (-1.0, -0.1),
                    (-1.0, -0.2),
                    (-0.1, -0.1),
                    (0.0, 0.0),
                    (1.0, 0.1),
                ],
            ),
            (
                0.01,
                [
                    (0.9, 0.9),
                    (0.0, 0.4),
                    (0.0, 0.0),
                    (-1.0, -0.005),
                    (0.5, 0.0),
                    (0.5, 0.005),
                    (0.0, 0.0),
                ],
            ),
            (
                1.6,
                [
                    (0.9, 0.9),
                    (0.0, 0.1),
                    (-1.0, 0.0),
                    (-1.0, -0.8),
                    (-1.0, -1.0),
                    (0.0, -0.2),
                    (1.0, 0.0),
                ],
            ),
        ] {
            let mut ramp = Ramp {
                value: 1.0,
                last: Some(Instant::EPOCH),
            };
            for ((target, expected), half_s) in targets.into_iter().zip(1..) {
                ramp.follow(at_us(500_000 * half_s), target, Some(rate_per_s));
                let value = ramp.value();
                assert!(
                    (value - expected).abs() < 1e-5,
                    "{value} at {rate_per_s} to {target}"
                );
            }
        }
    }

    #[test]
    fn without_a_limit_the_output_follows_at_once() {
        let mut ramp = Ramp::default();
        ramp.follow(Instant::EPOCH, -1.0, None);
        assert_eq!(ramp.value(), -1.0);
    }

    /// The duty after each 20 ms, in hundredths.
    fn reversed(targets: &[f32]) -> Vec<i32> {
        let mut reversal = Reversal::default();
        let outputs = targets.iter().enumerate().map(|(tick, target)| {
            let drive = MotorDrive::turn(*target);
            reversal.follow(at_us(tick as u64 * 20_000), drive);
            match reversal.limit(drive) {
                Turn(duty) => (100.0 * duty).round() as i32,
                _ => 0,
            }
        });
        outputs.collect()
    }

    #[test]
    // Requirement: R-14
    fn a_reversal_takes_a_quarter_of_a_second_and_a_start_or_a_stop_no_time() {
        assert_eq!(reversed(&[1.0, 0.3, 0.0, 1.0]), [100, 30, 0, 100]);
        let reversal = reversed(&[[1.0; 2].as_slice(), &[-1.0; 14]].concat());
        let ramp = (1..=14).map(|tick| -(8 * tick).min(100));
        assert_eq!(reversal, [100, 100].into_iter().chain(ramp).collect::<Vec<_>>());
        // A pause counts, and so does a small share the other way.
        assert_eq!(reversed(&[1.0, 0.0, 0.0, -1.0, -1.0])[3..], [-24, -32]);
        assert_eq!(reversed(&[1.0, -0.02, -0.02, -1.0])[1..], [-2, -2, -24]);
        // Back again: from nothing, too.
        assert_eq!(reversed(&[1.0, -1.0, -1.0, 1.0, 1.0])[3..], [8, 16]);
        assert_eq!(
            reversed(&[[1.0].as_slice(), &[0.0; 13], &[-1.0]].concat())[14],
            -100
        );
    }

    proptest::proptest! {
        /// Whatever is asked for, full power one way does not follow the other way's within a quarter of a second.
        #[test]
        fn no_sequence_of_sticks_reverses_faster(
            targets in proptest::collection::vec(-1.0f32..1.0, 2..60),
        ) {
            let outputs = reversed(&targets);
            for (first, output) in outputs.iter().enumerate() {
                for (ticks, later) in (1..13).zip(outputs.iter().skip(first + 1)) {
                    if output * later < 0 {
                        proptest::prop_assert!(later.abs() <= 8 * ticks, "{:?}", outputs);
                    }
                }
            }
        }
    }
}
