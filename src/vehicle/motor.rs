//! What the motors are told.

/// What a motor is told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum MotorDrive {
    /// It rolls freely: both inputs of its driver are low.
    #[default]
    Coast,
    /// It is held by its own short circuit: both inputs of its driver are high.
    Brake,
    /// It turns with this share of its power, from −1 (full speed back) to 1 (full speed ahead).
    Turn(f32),
}

/// What the motors of both sides are told; those of one side turn alike (skid steering).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct SideDrives {
    /// The motors on the left.
    pub left: MotorDrive,
    /// The motors on the right.
    pub right: MotorDrive,
}

impl SideDrives {
    /// All motors roll freely.
    pub const COAST: Self = Self {
        left: MotorDrive::Coast,
        right: MotorDrive::Coast,
    };

    /// All motors are held.
    pub const BRAKE: Self = Self {
        left: MotorDrive::Brake,
        right: MotorDrive::Brake,
    };
}

/// Below this share of its power a motor would only hum.
const LEAST_SHARE: f32 = 0.01;

impl MotorDrive {
    /// Turns with this share of its power (−1 to 1). With next to none it rolls freely: the driver has not asked it to
    /// stop.
    fn turn(share: f32) -> Self {
        if share.abs() < LEAST_SHARE {
            Self::Coast
        } else {
            Self::Turn(share)
        }
    }

    /// How much of its power it takes, from 0 to 1.
    fn effort(self) -> f32 {
        match self {
            Self::Coast | Self::Brake => 0.0,
            Self::Turn(share) => share.abs(),
        }
    }
}

impl SideDrives {
    /// Skid steering: both from −1 to 1. What would be more than full power on one side slows both, so that the curve
    /// stays the same.
    pub(super) fn mixed(throttle: f32, steering: f32) -> Self {
        let (left, right) = (throttle + steering, throttle - steering);
        let scale = left.abs().max(right.abs()).max(1.0);
        Self {
            left: MotorDrive::turn(left / scale),
            right: MotorDrive::turn(right / scale),
        }
    }

    /// How much of their power all motors take together, from 0 to 1.
    pub(super) fn effort(self) -> f32 {
        (self.left.effort() + self.right.effort()) / 2.0
    }
}

/// The rover's motors.
pub trait Motors {
    /// Tells them what to do from now on.
    fn drive(&mut self, drives: SideDrives);
}

#[cfg(test)]
mod tests {
    use super::*;
    use MotorDrive::{Coast, Turn};

    #[test]
    fn throttle_and_steering_are_mixed_and_neither_side_gets_more_than_all() {
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
    fn the_effort_is_the_mean_of_both_sides() {
        assert_eq!(SideDrives::mixed(0.0, 1.0).effort(), 1.0);
        assert_eq!(SideDrives::mixed(1.0, 1.0).effort(), 0.5);
        assert_eq!(SideDrives::BRAKE.effort(), 0.0);
    }
}
