use super::rover::{CLIPPED_A, IDLE_A, Pack, Rover, Sensors};
use super::*;
use crate::CurrentRange;

/// The current sensor's last step.
const FULL_SCALE_A: f32 = 30.0;

/// A stall: the sensor shows less than the pack delivers.
fn stalled(voltage_v: f32) -> Measurement {
    Measurement {
        current_range: CurrentRange::Over,
        ..loaded(voltage_v, FULL_SCALE_A)
    }
}

#[test]
fn a_current_over_range_counts_as_full_scale_and_is_announced_once() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, loaded(11.0, 0.0));
    for _ in 0..2 {
        bench.run(12.0, stalled(10.5));
        bench.run(1.0, loaded(11.0, 0.0));
    }
    let said = bench.count_of(PackEvent::CurrentOverRange(CurrentRange::Over));
    assert_eq!(said, 1, "{:?}", bench.events);
    let state = bench.state;
    assert_eq!(state.status, PackStatus::Healthy);
    assert_about(state.consumed_mah(), 200.0, 3.0);
}

#[test]
fn a_current_over_range_that_is_counted_all_the_same_is_announced_as_such_until_it_is_not() {
    let mut bench = MonitorBench::new();
    let counted = Measurement {
        current_range: CurrentRange::OverAndCounted,
        ..stalled(10.5)
    };
    let mut said = Vec::new();
    for measurement in [counted, counted, stalled(10.5), counted] {
        bench.run(1.0, measurement);
        said.push(
            [CurrentRange::OverAndCounted, CurrentRange::Over]
                .map(|range| bench.count_of(PackEvent::CurrentOverRange(range))),
        );
    }
    assert_eq!(said, [[1, 0], [1, 0], [1, 1], [1, 1]]);
}

#[test]
fn a_charge_that_was_drawn_over_range_is_uncertain_by_as_much_again() {
    for sensors in [Sensors::VoltageAndCurrent, Sensors::VoltageAndClippedCurrent] {
        let mut rover = Rover::with(Pack::rested(Chemistry::LiIon, 0.9));
        rover.bench.settings.capacity_mah = Some(2200.0);
        rover.run(40.0, IDLE_A);
        rover.sensors = sensors;
        // Half of the capacity, a third of which the clipped sensor shows.
        rover.run(1200.0, 3.0 * CLIPPED_A);
        let readings = rover.bench.state.readings;
        let is_covered = |sigma_pct: f32| rover.error_pct().abs() < 2.0 * sigma_pct;
        assert!(
            readings.remaining_sigma_pct.is_none_or(is_covered),
            "{sensors:?}: {readings:?}"
        );
    }
}

#[test]
fn a_voltage_failsafe_acts_while_the_current_is_over_range() {
    let mut bench = MonitorBench::new();
    bench.settings.failsafe.timer_s = Some(1.0);
    bench.settings.failsafe.low.voltage_v = Some(10.5);
    bench.load_state = LoadState::On;
    bench.run(1.0, loaded(11.4, 1.0));
    assert_eq!(bench.run(3.0, stalled(10.0)).failsafe, FailsafeLevel::Low);
}

#[test]
fn the_resistance_is_not_measured_by_a_current_over_range() {
    // 50 mOhm; a stall draws twice what the sensor shows.
    let pack_v = |current_a: f32| 12.0 - 0.05 * current_a;
    let mut bench = MonitorBench::new();
    for _ in 0..20 {
        bench.run(2.0, loaded(pack_v(0.0), 0.0));
        bench.run(2.0, loaded(pack_v(5.0), 5.0));
        bench.run(2.0, stalled(pack_v(2.0 * FULL_SCALE_A)));
    }
    assert_about(bench.state.resistance_ohm, 0.05, 0.003);
}

#[test]
fn a_reversed_sensor_is_announced_and_the_charge_estimated_without_it() {
    let announced = |rover: &Rover| rover.bench.count_of(PackEvent::CurrentReversed);
    for (sensors, expected) in [
        (Sensors::VoltageAndReversedCurrent, 1),
        (Sensors::VoltageAndCurrent, 0),
    ] {
        let mut rover = Rover::parked(Pack::rested(Chemistry::LiIon, 0.9));
        rover.sensors = sensors;
        rover.drive_to(0.6);
        assert_eq!(announced(&rover), expected);
        rover.run(60.0, IDLE_A);
        let sigma_pct = rover.bench.state.readings.remaining_sigma_pct.expect("known");
        let what = format!("{} ± {sigma_pct} %", rover.reported_pct());
        assert!(rover.error_pct().abs() <= 2.0 * sigma_pct, "{what}");
        // The sign is put right.
        if sensors == Sensors::VoltageAndReversedCurrent {
            rover.measuring.scale.amperes_per_volt *= -1.0;
        }
        rover.drive_to(0.3);
        assert_eq!(announced(&rover), expected, "once");
        assert!(rover.bench.state.resistance_ohm.is_some());
        rover.assert_error_below(10.0, "driven further");
    }
}

#[test]
fn braking_and_charging_reverse_no_sensor() {
    let mut bench = MonitorBench::new();
    bench.run(30.0, loaded(12.0, 0.2));
    bench.load_state = LoadState::On;
    for _ in 0..50 {
        bench.run(3.0, loaded(11.8, 5.0));
        bench.run(1.0, loaded(12.2, -5.0));
    }
    bench.load_state = LoadState::Off;
    for _ in 0..50 {
        bench.run(3.0, loaded(12.2, -3.0));
        bench.run(3.0, loaded(12.0, 0.0));
    }
    assert!(!bench.events.contains(&PackEvent::CurrentReversed));
}
