//! The rover around the board: a pack of two cells, four motors at their drivers, the divider, and a current sensor.

use emulator::circuit::{Bridge, Circuit, Motor, Supply, Switches};
use emulator::{AdcInput, CurrentSensor, SensorRange};
use support::motor_poles::motors;

use crate::bench::{Bench, CURRENT, PACK};

/// Two Li-ion cells, half full.
pub const OPEN_CIRCUIT_V: f64 = 7.9;

/// Three LiPo cells, half full.
pub const THREE_CELLS_V: f64 = 11.4;

/// Of cells, holder and wires.
pub const RESISTANCE_OHM: f64 = 0.25;

/// Board and lamps.
const BASE_A: f64 = 0.2;

/// `BATT_VOLT_MULT`, by default.
const DIVIDER: f64 = 3.95;

/// Of the current sensor at GP27.
pub const VOLTS_PER_AMPERE: f64 = 0.1;
const ZERO_V: f64 = 0.5;

/// Some counts of the converter.
const NOISE_V: f64 = 0.002;

/// Parameters with which the firmware measures this pack's current.
pub const WITH_SENSOR: [(&str, f32); 5] = [
    ("BATT_MONITOR", 4.0),
    ("BATT_CURR_PIN", 27.0),
    ("BATT_AMP_PERVLT", 10.0),
    ("BATT_AMP_OFFSET", 0.5),
    ("BATT_CELLS", 2.0),
];

/// A pack that supplies the board and its motors.
pub fn supply(open_circuit_v: f64) -> Supply {
    Supply {
        open_circuit_v,
        resistance_ohm: RESISTANCE_OHM,
        base_a: BASE_A,
    }
}

/// Connects everything to the board. The sensor is linear through zero, as motors that coast charge the pack.
pub fn connect(bench: &mut Bench, open_circuit_v: f64) {
    let bridges: Vec<_> = motors()
        .map(|motor| Bridge {
            pins: [motor.positive, motor.negative],
            switches: Switches::DRV8837,
            motor: Some(Motor::TT),
        })
        .collect();
    bench.attach_circuit(Circuit::new(supply(open_circuit_v), &bridges));
    bench.adc_noise(NOISE_V);
    bench.adc_input(PACK, AdcInput::PackVoltage(1.0 / DIVIDER));
    bench.adc_input(CURRENT, AdcInput::PackCurrent(sensor(SensorRange::BothWays)));
}

/// The current sensor, with the range that it has.
pub fn sensor(range: SensorRange) -> CurrentSensor {
    CurrentSensor {
        volts_per_ampere: VOLTS_PER_AMPERE,
        offset_v: ZERO_V,
        range,
    }
}
