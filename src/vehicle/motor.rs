//! Motor outputs and their mixing.

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

#[cfg(test)]
mod tests {
    use super::*;
    use MotorDrive::{Coast, Turn};

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
}
