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

/// The rover's motors.
pub trait Motors {
    /// Tells them what to do from now on.
    fn drive(&mut self, drives: SideDrives);
}
