//! Which way each wheel turns, at the poles of its motor.

use crate::rover::{GOOD_3S, steer_for};
use emulator::Board;
use support::motor_poles::{LEFT, Motor, RIGHT, motors};
use support::requests::{arm, manual_mode};
use workbench::bench::{Bench, SECOND, TestedVehicle};
use workbench::rover_circuit::{THREE_CELLS_V, connect};

/// The share of time in which the PWM drives the positive and the negative pole.
pub fn duties(motor: Motor, board: &Board) -> (f64, f64) {
    let duty = |pin| board.pwm_output(pin).map_or(0.0, |output| output.duty);
    (duty(motor.positive), duty(motor.negative))
}

/// Both poles of all motors.
pub fn pins() -> impl Iterator<Item = usize> {
    motors().flat_map(|motor| [motor.positive, motor.negative])
}

const AHEAD: (f64, f64) = (0.5, 0.0);
const BACK: (f64, f64) = (0.0, 0.5);

#[test]
// Requirement: R-1
fn every_wheel_turns_the_way_the_driver_steers() {
    let mut bench = Bench::configured(GOOD_3S, &[("BATT_CELLS", 3.0)]);
    connect(&mut bench, THREE_CELLS_V);
    bench.ask(&arm());
    bench.ask(&manual_mode());
    steer_for(&mut bench, SECOND / 10, 0, 0);
    for (maneuver, steering, throttle, left, right) in [
        ("ahead", 0, 500, AHEAD, AHEAD),
        ("back", 0, -500, BACK, BACK),
        ("turning right in place", 500, 0, AHEAD, BACK),
        ("turning left in place", -500, 0, BACK, AHEAD),
    ] {
        steer_for(&mut bench, 2 * SECOND, steering, throttle);
        for (motors, expected) in [(LEFT, left), (RIGHT, right)] {
            for motor in motors {
                let (positive, negative) = duties(motor, &bench);
                assert!(
                    (positive - expected.0).abs() < 0.01 && (negative - expected.1).abs() < 0.01,
                    "{maneuver}, {}: {positive} at the positive pole, {negative} at the negative one",
                    motor.name
                );
            }
        }
    }
}
