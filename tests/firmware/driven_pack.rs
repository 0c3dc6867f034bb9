//! Readings and counts of a pack while the motors' pulses draw on it: means, at every duty.

use crate::wheels::duties;
use emulator::circuit::Means;
use emulator::{AdcCurve, AdcInput, SensorRange};
use support::frames::texts_of;
use support::motor_poles::{LEFT, RIGHT};
use support::requests::disarm;
use workbench::bench::{Bench, CURRENT, MILLISECOND, SECOND, TestedVehicle};
use workbench::downloads::{download, list};
use workbench::driven_rover::{
    FULL, Reading, Sides, drive_steadily, readings_since, rover, steer_for, totals,
};
use workbench::log_records::{named, records};
use workbench::rover_circuit::{RESISTANCE_OHM, sensor};

/// PWM slices of the motors (RP2040 datasheet 4.5): each counts to 62,500 in 2 ms.
const SLICES: std::ops::RangeInclusive<u32> = 1..=4;
const COUNTER: u32 = 0x4005_0008;
const SLICE_BYTES: u32 = 0x14;
const PERIOD_COUNTS: u32 = 62_500;

/// By erratum RP2040-E11 a code is up to this much off, in volts at the pack and amperes.
const WIDE_CODES_V: f64 = 0.0145;
const WIDE_CODES_A: f64 = 0.036;

/// As after another power-up, at which the conversions began a third of a PWM period later.
fn shift_by_a_third(bench: &mut Bench) {
    for slice in SLICES {
        let counter = COUNTER + SLICE_BYTES * slice;
        let count = bench.read_register(counter);
        bench.write_register(counter, (count + PERIOD_COUNTS / 3) % PERIOD_COUNTS);
    }
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
        let drive = drive_steadily(&mut bench, sides, share);
        let (duty, _) = duties(LEFT[0], &bench);
        assert!(
            (duty - share).abs() < 0.01,
            "{sides:?}: {duty} instead of {share}"
        );
        let (other, _) = duties(RIGHT[0], &bench);
        assert_eq!(other > 0.0, sides == Sides::Both);
        assert!(drive.readings.len() >= 8, "{}", drive.readings.len());
        let (error_v, error_a) = drive.worst_errors();
        let (volts, amperes) = tolerances(curve, &drive.means);
        assert!(
            error_v <= volts && error_a <= amperes,
            "{sides:?} at {share}: {:?} instead of {:?}",
            drive.readings,
            drive.means
        );
        worst = (worst.0.max(error_v), worst.1.max(error_a));
    }
    println!(
        "{curve:?}, {sides:?}: at most {:.1} mV and {:.0} mA off",
        worst.0 * 1e3,
        worst.1 * 1e3
    );
}

#[test]
// Requirement: R-16
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
    steer_for(&mut bench, SECOND / 2, 0, 0);
    for step in (1..=40).chain((1..40).rev()) {
        steer_for(&mut bench, 100 * MILLISECOND, 0, step * (FULL / 40));
    }
    steer_for(&mut bench, SECOND, 0, 0);
    let means = totals(&mut bench).since(before).expect("some seconds");
    let readings = readings_since(&mut bench, from_us);
    let Reading { voltage_v, current_a } = Reading::mean_of(&readings);
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
    steer_for(bench, 2 * SECOND, 0, 0);
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
    assert!(extremes.least.volts < 7.0, "{extremes:?}");
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

/// Motors that coast or are reversed return current, which such a sensor shows as none.
#[test]
fn a_sensor_that_ends_at_zero_reads_a_little_too_much_of_a_drive() {
    let means = |range| {
        let mut bench = rover(AdcCurve::Ideal, &[]);
        bench.adc_input(CURRENT, AdcInput::PackCurrent(sensor(range)));
        let (from_us, before) = (bench.time_us(), totals(&mut bench));
        for throttle in [FULL, -FULL, FULL, -FULL, 0] {
            steer_for(&mut bench, SECOND, 0, throttle);
        }
        let true_a = totals(&mut bench).since(before).expect("some seconds").amperes;
        let readings = readings_since(&mut bench, from_us);
        (Reading::mean_of(&readings).current_a, true_a)
    };
    let (both_ways_a, true_a) = means(SensorRange::BothWays);
    let (from_zero_a, _) = means(SensorRange::FromZero);
    println!("{from_zero_a:.3} A with a sensor that ends at 0 A, else {both_ways_a:.3} A, of {true_a:.3} A");
    assert!((both_ways_a / true_a - 1.0).abs() < 0.02);
    assert!(from_zero_a > both_ways_a && from_zero_a < 1.02 * both_ways_a);
}
