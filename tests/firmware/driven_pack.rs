//! What is measured of a pack while the motors' pulses draw on it: the mean, at every duty, and what is counted of it.

use crate::rover::{drive_for, steer_for};
use crate::wheels::duties;
use emulator::AdcCurve;
use emulator::circuit::{Means, Totals};
use support::frames::{statuses_of, texts_of};
use support::motor_poles::{LEFT, RIGHT};
use support::requests::{arm, disarm, manual_mode};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle};
use workbench::downloads::{download, list};
use workbench::log_records::{named, records};
use workbench::rover_circuit::{OPEN_CIRCUIT_V, RESISTANCE_OHM, WITH_SENSOR, connect};

/// PWM slices of the motors (RP2040 datasheet 4.5): each counts to 62,500 in 2 ms.
const SLICES: std::ops::RangeInclusive<u32> = 1..=4;
const COUNTER: u32 = 0x4005_0008;
const SLICE_BYTES: u32 = 0x14;
const PERIOD_COUNTS: u32 = 62_500;

/// By erratum RP2040-E11 a code is up to this much off, in volts at the pack and amperes.
const WIDE_CODES_V: f64 = 0.0145;
const WIDE_CODES_A: f64 = 0.036;

/// The stick's full throw.
const FULL: i16 = 1000;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Sides {
    Both,
    Left,
}

impl Sides {
    /// Lets time pass with these sides at a share of full throttle.
    fn drive(self, bench: &mut Bench, time_us: u64, share: f64) {
        let throttle = share * f64::from(FULL);
        match self {
            Self::Both => steer_for(bench, time_us, 0, throttle as i16),
            Self::Left => steer_for(bench, time_us, (throttle / 2.0) as i16, (throttle / 2.0) as i16),
        }
    }
}

/// A rover that may be driven, with its pack and motors.
fn rover(curve: AdcCurve, parameters: &[(&str, f32)]) -> Bench {
    let mut all = WITH_SENSOR.to_vec();
    all.push(("SR0_EXTRA1", 10.0));
    all.extend(parameters);
    let mut bench = Bench::configured(DIVIDER_CODE, &all);
    bench.adc_curve(curve);
    connect(&mut bench, OPEN_CIRCUIT_V);
    // What was measured before is of another pack.
    bench.reboot();
    bench.run_for(SECOND);
    bench.ask(&arm());
    bench.ask(&manual_mode());
    drive_for(&mut bench, SECOND / 5, 0);
    bench
}

/// As after another power-up, at which the conversions began a third of a PWM period later.
fn shift_by_a_third(bench: &mut Bench) {
    for slice in SLICES {
        let counter = COUNTER + SLICE_BYTES * slice;
        let count = bench.read_register(counter);
        bench.write_register(counter, (count + PERIOD_COUNTS / 3) % PERIOD_COUNTS);
    }
}

fn totals(bench: &mut Bench) -> Totals {
    bench.circuit().totals()
}

/// Voltages and currents on the wire since `from_us`.
fn reported(bench: &mut Bench, from_us: u64) -> Vec<(f64, f64)> {
    bench.run_until_silent();
    let frames = bench.frames_since(from_us);
    let statuses = statuses_of(&frames, 0).into_iter();
    statuses
        .map(|status| {
            (
                f64::from(status.voltage_mv(0)) / 1e3,
                f64::from(status.current_ca()) / 1e2,
            )
        })
        .collect()
}

/// Tolerances of a voltage and of a current in a steady drive.
fn tolerances(curve: AdcCurve, means: &Means) -> (f64, f64) {
    let (volts, amperes) = (0.020, (0.02 * means.amperes).max(0.050));
    match curve {
        AdcCurve::Ideal => (volts, amperes),
        AdcCurve::Rp2040 => (volts + WIDE_CODES_V, amperes + WIDE_CODES_A),
    }
}

/// Panics unless each reading is the mean of its time, at 16 duties.
fn assert_means(curve: AdcCurve, sides: Sides, shift: impl Fn(&mut Bench)) {
    let mut bench = rover(curve, &[]);
    shift(&mut bench);
    let mut worst = (0.0f64, 0.0f64);
    for step in 1..=16 {
        let share = f64::from(step) / 16.0;
        sides.drive(&mut bench, SECOND, share);
        let (duty, _) = duties(LEFT[0], &bench);
        assert!(
            (duty - share).abs() < 0.01,
            "{sides:?}: {duty} instead of {share}"
        );
        let (other, _) = duties(RIGHT[0], &bench);
        assert_eq!(other > 0.0, sides == Sides::Both);
        let before = totals(&mut bench);
        let from_us = bench.time_us() + 150 * MILLISECOND;
        sides.drive(&mut bench, SECOND, share);
        let means = totals(&mut bench).since(before).expect("a second");
        let (volts, amperes) = tolerances(curve, &means);
        let readings = reported(&mut bench, from_us);
        assert!(readings.len() >= 8, "{}", readings.len());
        for (voltage_v, current_a) in readings {
            let errors = (voltage_v - means.volts, current_a - means.amperes);
            assert!(
                errors.0.abs() <= volts && errors.1.abs() <= amperes,
                "{sides:?} at {share}: {voltage_v} V, {current_a} A instead of {means:?}"
            );
            worst = (worst.0.max(errors.0.abs()), worst.1.max(errors.1.abs()));
        }
    }
    println!(
        "{curve:?}, {sides:?}: at most {:.1} mV and {:.0} mA off",
        worst.0 * 1e3,
        worst.1 * 1e3
    );
}

#[test]
fn voltage_and_current_of_a_drive_are_means_whichever_sides_drive() {
    for sides in [Sides::Both, Sides::Left] {
        assert_means(AdcCurve::Ideal, sides, |_| {});
    }
}

#[test]
fn voltage_and_current_of_a_drive_are_means_whenever_the_conversions_began() {
    for sides in [Sides::Both, Sides::Left] {
        assert_means(AdcCurve::Ideal, sides, shift_by_a_third);
    }
}

#[test]
fn the_converters_wide_codes_move_a_mean_by_their_known_error_only() {
    for sides in [Sides::Both, Sides::Left] {
        assert_means(AdcCurve::Rp2040, sides, |_| {});
    }
}

#[test]
fn readings_are_means_while_the_duty_changes_too() {
    let mut bench = rover(AdcCurve::Ideal, &[]);
    let (from_us, before) = (bench.time_us(), totals(&mut bench));
    drive_for(&mut bench, SECOND / 2, 0);
    for step in (1..=40).chain((1..40).rev()) {
        drive_for(&mut bench, 100 * MILLISECOND, step * (FULL / 40));
    }
    drive_for(&mut bench, SECOND, 0);
    let means = totals(&mut bench).since(before).expect("some seconds");
    let readings = reported(&mut bench, from_us);
    let count = readings.len() as f64;
    let voltage_v = readings.iter().map(|reading| reading.0).sum::<f64>() / count;
    let current_a = readings.iter().map(|reading| reading.1).sum::<f64>() / count;
    println!("ramps: {voltage_v:.3} V, {current_a:.3} A; {means:?}");
    assert!((voltage_v - means.volts).abs() <= 0.020, "{voltage_v}, {means:?}");
    let tolerance_a = (0.02 * means.amperes).max(0.050);
    assert!(
        (current_a - means.amperes).abs() <= tolerance_a,
        "{current_a}, {means:?}"
    );
}

/// Stops, starts, turns and reversals for two minutes.
fn stop_and_go(bench: &mut Bench) {
    let mut random = fastrand::Rng::with_seed(40);
    let until_us = bench.time_us() + 120 * SECOND;
    while bench.time_us() < until_us {
        let time_us = random.u64(5..30) * 100 * MILLISECOND;
        let (steering, throttle) = match random.u8(..4) {
            0 => (0, 0),
            1 => (random.i16(-FULL..FULL), random.i16(-FULL..FULL)),
            _ => (0, random.i16(200..FULL)),
        };
        steer_for(bench, time_us, steering, throttle);
    }
    drive_for(bench, 2 * SECOND, 0);
}

#[test]
fn charge_energy_and_resistance_of_a_stop_and_go_drive_are_those_of_the_pack() {
    // The voltage falls below these while motors are switched on, and its mean does not.
    let thresholds = [
        ("BATT_LOW_VOLT", 7.15),
        ("BATT_CRT_VOLT", 7.0),
        ("BATT_LOW_TIMER", 1.0),
        ("BATT_FS_LOW_ACT", 0.0),
    ];
    let mut bench = rover(AdcCurve::Ideal, &thresholds);
    let before = totals(&mut bench);
    let armed_us = bench.time_us();
    stop_and_go(&mut bench);
    let after = totals(&mut bench);
    let ended_us = bench.time_us();
    let extremes = bench.circuit().extremes();
    let announced = texts_of(&bench.frames_since(armed_us));
    bench.ask(&disarm());
    bench.run_for(2 * SECOND);
    let files = list(&mut bench);
    let content = download(&mut bench, *files.last().expect("a log"));
    let records = records(&content);
    let field = |name| -> Vec<f64> {
        let records = named(&records, "BAT").filter(|record| {
            let at_us = record.timestamp_usec.expect("a time");
            (armed_us..ended_us).contains(&(at_us + boot_us(&bench)))
        });
        records.filter_map(|record| record.get_f64(name)).collect()
    };
    let increase = |name| {
        let values = field(name);
        values.last().expect("some") - values.first().expect("some")
    };
    let (charge_c, energy_j) = (increase("CurrTot") * 3.6, increase("EnrgTot") * 3600.0);
    let (drawn_c, drawn_j) = (after.coulombs - before.coulombs, after.joules - before.joules);
    let resistance_ohm = *field("Res").last().expect("some");
    println!(
        "{charge_c:.2} C of {drawn_c:.2}, {energy_j:.1} J of {drawn_j:.1}, {resistance_ohm:.4} ohm; {extremes:?}"
    );
    assert!((charge_c / drawn_c - 1.0).abs() <= 0.005);
    assert!((energy_j / drawn_j - 1.0).abs() <= 0.01);
    assert!((resistance_ohm / RESISTANCE_OHM - 1.0).abs() <= 0.1);
    let is_level = |text: &&String| text.contains(" is low") || text.contains(" is critical");
    assert_eq!(announced.iter().find(is_level), None);
}

/// The time of the last start, since power-up.
fn boot_us(bench: &Bench) -> u64 {
    bench.resets().last().map_or(0, |reset| reset.time_us)
}
