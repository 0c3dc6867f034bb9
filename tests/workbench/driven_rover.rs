//! A rover that is driven on its circuit, and what it reports of its pack beside the true means.

use crate::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle};
use crate::rover_circuit::{OPEN_CIRCUIT_V, WITH_SENSOR, connect};
use emulator::AdcCurve;
use emulator::circuit::{Means, Totals};
use support::frames::statuses_of;
use support::requests::{VEHICLE_ID, arm, manual_control, manual_mode};

/// The stick's full throw.
pub const FULL: i16 = 1000;

/// The sides that are driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sides {
    Both,
    Left,
}

/// A reading on the wire.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    pub voltage_v: f64,
    pub current_a: f64,
}

impl Reading {
    /// The mean of some readings.
    pub fn mean_of(readings: &[Self]) -> Self {
        let mean = |value: fn(&Self) -> f64| readings.iter().map(value).sum::<f64>() / readings.len() as f64;
        Self {
            voltage_v: mean(|reading| reading.voltage_v),
            current_a: mean(|reading| reading.current_a),
        }
    }
}

/// A second of a steady drive.
pub struct SteadyDrive {
    pub means: Means,
    pub readings: Vec<Reading>,
}

impl SteadyDrive {
    /// Errors of the worst reading, in volts and amperes.
    pub fn worst_errors(&self) -> (f64, f64) {
        let worst = |error: fn(&Means, &Reading) -> f64| {
            let errors = self
                .readings
                .iter()
                .map(|reading| error(&self.means, reading).abs());
            errors.fold(0.0, f64::max)
        };
        (
            worst(|means, reading| reading.voltage_v - means.volts),
            worst(|means, reading| reading.current_a - means.amperes),
        )
    }
}

/// A rover that may be driven, with its pack and motors. It reports ten times a second.
pub fn rover(curve: AdcCurve, parameters: &[(&str, f32)]) -> Bench {
    let mut all = WITH_SENSOR.to_vec();
    all.push(("SR0_EXTRA1", 10.0));
    all.extend(parameters);
    let mut bench = Bench::configured(DIVIDER_CODE, &all);
    bench.adc_curve(curve);
    connect(&mut bench, OPEN_CIRCUIT_V);
    // Readings before this are of another pack.
    bench.reboot();
    bench.run_for(SECOND);
    bench.ask(&arm());
    bench.ask(&manual_mode());
    steer_for(&mut bench, SECOND / 5, 0, 0);
    bench
}

/// Lets time pass with constant stick input.
pub fn steer_for(bench: &mut Bench, time_us: u64, steering: i16, throttle: i16) {
    for _ in 0..time_us / (100 * MILLISECOND) {
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &manual_control(VEHICLE_ID, steering, throttle));
        bench.run_for(100 * MILLISECOND);
    }
}

/// Charge and energy so far.
pub fn totals(bench: &mut Bench) -> Totals {
    bench.circuit().totals()
}

/// Drives steadily for two seconds at a share of full throttle, of which the second one counts.
pub fn drive_steadily(bench: &mut Bench, sides: Sides, share: f64) -> SteadyDrive {
    let throttle = (share * f64::from(FULL)) as i16;
    let (steering, throttle) = match sides {
        Sides::Both => (0, throttle),
        Sides::Left => (throttle / 2, throttle / 2),
    };
    steer_for(bench, SECOND, steering, throttle);
    let before = totals(bench);
    // The readings of what came before have left.
    let from_us = bench.time_us() + 150 * MILLISECOND;
    steer_for(bench, SECOND, steering, throttle);
    SteadyDrive {
        means: totals(bench).since(before).expect("a second"),
        readings: readings_since(bench, from_us),
    }
}

/// Readings on the wire since `from_us`.
pub fn readings_since(bench: &mut Bench, from_us: u64) -> Vec<Reading> {
    bench.run_until_silent();
    let frames = bench.frames_since(from_us);
    let statuses = statuses_of(&frames, 0).into_iter();
    statuses
        .map(|status| Reading {
            voltage_v: f64::from(status.voltage_mv(0)) / 1e3,
            current_a: f64::from(status.current_ca()) / 1e2,
        })
        .collect()
}
