//! The poles of the four motors, as the vendor's headers name them. No test has another copy of these pins.
//!
//! The headers of the sketches "Freenove_4WD_Car_For_Pico_W" define a `PIN_MOTOR_PWM_…` for each pole, and name the pole and
//! its motor in a comment. M1 alone has its positive pole at the lower pin.

/// The motor of a wheel, by the pins of its poles. While the wheel turns ahead, the positive one alone is driven.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    pub name: &'static str,
    pub positive: usize,
    pub negative: usize,
}

impl Motor {
    const fn new(name: &'static str, positive: usize, negative: usize) -> Self {
        Self {
            name,
            positive,
            negative,
        }
    }
}

/// The motors on the left.
pub const LEFT: [Motor; 2] = [
    // PIN_MOTOR_PWM_LEFT1 and PIN_MOTOR_PWM_LEFT2.
    Motor::new("M1 left front", 18, 19),
    // PIN_MOTOR_PWM_LEFT3 and PIN_MOTOR_PWM_LEFT4.
    Motor::new("M2 left rear", 21, 20),
];

/// The motors on the right.
pub const RIGHT: [Motor; 2] = [
    // PIN_MOTOR_PWM_RIGHT1 and PIN_MOTOR_PWM_RIGHT2.
    Motor::new("M3 right rear", 7, 6),
    // PIN_MOTOR_PWM_RIGHT3 and PIN_MOTOR_PWM_RIGHT4.
    Motor::new("M4 right front", 9, 8),
];

/// All four motors, those on the left first.
pub fn motors() -> impl Iterator<Item = Motor> {
    LEFT.into_iter().chain(RIGHT)
}
