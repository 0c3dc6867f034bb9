//! Power consumption of the simulated rover.

use std::cell::Cell;

use rover_battmon::vehicle::{MotorDrive, Motors, SideDrives};

/// Board, radio and lamps, in amperes.
const ELECTRONICS_A: f32 = 0.2;

/// Idle current of a small gear motor, and its increase at full power, in amperes.
const FREE_RUNNING_A: f32 = 0.2;
const FULL_POWER_A: f32 = 0.8;

const MOTORS_PER_SIDE: f32 = 2.0;

/// A rover with four motors, on blocks.
#[derive(Debug, Default)]
pub struct SimulatedRover {
    drives: Cell<SideDrives>,
}

impl SimulatedRover {
    /// Present motor outputs.
    pub fn drives(&self) -> SideDrives {
        self.drives.get()
    }

    /// Total current, in amperes.
    pub fn current_a(&self) -> f32 {
        let SideDrives { left, right } = self.drives.get();
        ELECTRONICS_A + MOTORS_PER_SIDE * (motor_current_a(left) + motor_current_a(right))
    }
}

impl Motors for &SimulatedRover {
    fn drive(&mut self, drives: SideDrives) {
        self.drives.set(drives);
    }
}

fn motor_current_a(drive: MotorDrive) -> f32 {
    match drive {
        MotorDrive::Turn(power) if power != 0.0 => FREE_RUNNING_A + FULL_POWER_A * power * power,
        MotorDrive::Turn(_) | MotorDrive::Coast | MotorDrive::Brake => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn current_depends_on_the_motors() {
        let rover = SimulatedRover::default();
        assert_eq!(rover.current_a(), 0.2);
        (&rover).drive(SideDrives {
            left: MotorDrive::Turn(1.0),
            right: MotorDrive::Turn(-0.5),
        });
        assert!((rover.current_a() - 3.0).abs() < 1e-5, "{}", rover.current_a());
        (&rover).drive(SideDrives::BRAKE);
        assert_eq!(rover.current_a(), 0.2);
    }
}
