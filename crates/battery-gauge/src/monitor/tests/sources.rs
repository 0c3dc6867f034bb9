//! Gauges and counters at the source of a measurement: what they miss, and what they contradict.

use super::*;
use crate::chemistry::CHEMISTRIES;

/// For how long a gauge may be silent, in seconds.
const GAUGE_TIMEOUT_S: f32 = 12.0;

/// A pack of 20 Ah whose gauge says that half is left, read with thresholds far above half of `BATT_CAPACITY`.
fn gauged_bench() -> MonitorBench {
    let mut bench = MonitorBench::new();
    bench.settings.failsafe.low.remaining_mah = Some(4000.0);
    bench.settings.failsafe.critical.remaining_mah = Some(2000.0);
    bench.load_state = LoadState::On;
    bench
}

fn half_full(gauge: GaugeReading) -> Measurement {
    Measurement {
        gauge,
        ..loaded(11.5, 5.0)
    }
}

/// A reading without the gauge's report, and with this charge.
fn missing(state_of_charge: Option<f32>) -> Measurement {
    Measurement {
        state_of_charge,
        ..half_full(GaugeReading::Missing)
    }
}

const HALF_OF_20_AH: GaugeReading = GaugeReading::Read(Gauge {
    remaining_mah: 10_000.0,
    full_mah: 20_000.0,
});

#[test]
// Requirement: L-12
fn readings_without_the_gauge_trip_no_threshold_in_mah() {
    for soc in [None, Some(0.5)] {
        let missing = missing(soc);
        let mut bench = gauged_bench();
        bench.run(1.0, half_full(HALF_OF_20_AH));
        let state = bench.run(0.1, missing);
        assert_eq!(state.charge_source, ChargeSource::Gauge);
        assert_eq!(
            (state.readings.remaining_pct, state.capacity_mah()),
            (Some(50.0), Some(20_000.0))
        );
        bench.run(60.0, missing);
        bench.run(1.0, half_full(HALF_OF_20_AH));
        assert!(bench.state.failsafe <= FailsafeLevel::Unhealthy, "{soc:?}");
    }
}

#[test]
fn before_the_first_report_of_a_gauge_its_capacity_is_unknown() {
    for soc in [None, Some(0.5)] {
        let missing = missing(soc);
        let mut bench = gauged_bench();
        let state = bench.run(GAUGE_TIMEOUT_S - 1.0, missing);
        assert_eq!(
            (state.readings.remaining_pct, state.capacity),
            (soc.map(|soc| soc * 100.0), None)
        );
        let expected = (FailsafeLevel::None, PackStatus::Healthy);
        assert_eq!((state.failsafe, state.status), expected);
        assert_ne!(state.charge_source, ChargeSource::Estimated);
        let state = bench.run(1.0, half_full(HALF_OF_20_AH));
        assert_eq!(state.capacity_mah(), Some(20_000.0));
    }
}

#[test]
fn a_gauge_that_never_reports_or_is_not_to_be_used_is_none() {
    for (first, then, seconds) in [
        (
            GaugeReading::Missing,
            GaugeReading::Missing,
            GAUGE_TIMEOUT_S - 4.0,
        ),
        (HALF_OF_20_AH, GaugeReading::Absent, 0.1),
    ] {
        let mut bench = MonitorBench::new();
        bench.run(5.0, half_full(first));
        let state = bench.run(seconds, half_full(then));
        assert_eq!(state.charge_source, ChargeSource::Estimated);
        assert_eq!(state.capacity_mah(), Some(2200.0));
        assert!(state.readings.remaining_pct.is_some());
    }
}

#[test]
// Requirement: S-8
fn after_its_time_out_the_charge_of_a_gauge_is_unknown_and_never_estimated() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, half_full(HALF_OF_20_AH));
    let state = bench.run(GAUGE_TIMEOUT_S - 1.0, half_full(GaugeReading::Missing));
    assert_eq!(
        (state.readings.remaining_pct, state.consumed_mah()),
        (Some(50.0), Some(10_000.0))
    );
    let state = bench.run(600.0, half_full(GaugeReading::Missing));
    assert_eq!(state.charge_source, ChargeSource::Gauge);
    let readings = state.readings;
    assert_eq!(
        (readings.remaining_pct, readings.usable_pct, state.consumed),
        (None, None, None)
    );
    assert_eq!(
        (readings.time_remaining_s, readings.remaining_sigma_pct),
        (None, None)
    );
    assert_eq!(state.status, PackStatus::Healthy, "no threshold needs it");
    bench.reset(100.0);
    let state = bench.run(1.0, half_full(GaugeReading::Missing));
    assert_eq!(state.readings.remaining_pct, None);
    let state = bench.run(0.1, half_full(HALF_OF_20_AH));
    assert_eq!(state.readings.remaining_pct, Some(50.0));
}

#[test]
fn full_capacity_once_heard_stays_until_another_pack() {
    let mut bench = MonitorBench::new();
    let at_rest = |voltage_v, gauge| Measurement {
        gauge,
        state_of_charge: Some(0.5),
        ..loaded(voltage_v, 0.0)
    };
    bench.run(5.0, at_rest(11.0, HALF_OF_20_AH));
    let state = bench.run(3600.0, at_rest(11.0, GaugeReading::Missing));
    assert_eq!(
        (state.capacity_mah(), state.readings.remaining_pct),
        (Some(20_000.0), Some(50.0))
    );
    bench.run(3.0, volts(0.3));
    let state = bench.run(5.0, at_rest(12.4, GaugeReading::Missing));
    assert!(bench.events.contains(&PackEvent::Swapped));
    assert_eq!(state.capacity, None);
}

#[test]
// Requirement: S-8
fn timed_out_gauge_is_unhealthy_and_announced_while_a_threshold_needs_it() {
    let mut bench = gauged_bench();
    bench.run(1.0, half_full(HALF_OF_20_AH));
    bench.run(GAUGE_TIMEOUT_S - 0.5, half_full(GaugeReading::Missing));
    assert_eq!((bench.state.status, bench.events.len()), (PackStatus::Healthy, 0));
    let state = bench.run(1.0, half_full(GaugeReading::Missing));
    assert_eq!(state.status, PackStatus::Unhealthy);
    assert_eq!(bench.events, [PackEvent::SensorFailed(ReadError::GaugeTimeout)]);
    let state = bench.run(6.0, half_full(GaugeReading::Missing));
    assert_eq!(state.failsafe, FailsafeLevel::Unhealthy);
    // Its voltage is measured all the same.
    bench.settings.failsafe.timer_s = Some(1.0);
    bench.settings.failsafe.low.voltage_v = Some(10.5);
    let low = Measurement {
        voltage_v: Some(10.0),
        ..half_full(GaugeReading::Missing)
    };
    let state = bench.run(3.0, low);
    assert_eq!(
        (state.failsafe, state.readings.voltage_v),
        (FailsafeLevel::Low, Some(10.0))
    );
    let state = bench.run(6.0, half_full(HALF_OF_20_AH));
    assert_eq!(state.status, PackStatus::Healthy);
    assert_eq!(bench.events.last(), Some(&PackEvent::SensorRecovered));
}

/// A reading of a companion computer that counts, and may measure the current.
fn companion(total_mah: f32, current_a: Option<f32>) -> Measurement {
    Measurement {
        current_a,
        counted: Some(Counted::TotalCharge(total_mah)),
        ..volts(12.0)
    }
}

/// Lets a companion's count rise at this current from 0, in whole milliampere-hours, while the voltage is that of a pack of
/// 2200 mAh of which `drawn_mah` was drawn before.
fn count(bench: &mut MonitorBench, seconds: f32, drawn_mah: f32, load_a: f32, current_a: Option<f32>) {
    for tick in 0..(seconds * 10.0) as u32 {
        let total_mah = load_a * tick as f32 * 0.1 / 3.6;
        let true_a = load_a.max(current_a.unwrap_or(0.0));
        let true_mah = drawn_mah + true_a * tick as f32 * 0.1 / 3.6;
        let soc = (1.0 - true_mah / 2200.0).max(0.5);
        let voltage_v = 3.0 * Chemistry::LiPo.cell().curve.voltage_v(soc);
        bench.tick(Ok(Measurement {
            voltage_v: Some(voltage_v),
            ..companion(total_mah.floor(), current_a)
        }));
    }
}

#[test]
// Requirement: S-10
fn a_count_beyond_the_capacity_leaves_nothing_whatever_the_voltage() {
    for current_a in [None, Some(0.0), Some(5.0)] {
        let mut bench = MonitorBench::new();
        bench.settings.failsafe.critical.remaining_mah = Some(100.0);
        bench.run(60.0, companion(0.0, current_a));
        assert!(bench.state.readings.remaining_pct.expect("known") > 50.0);
        bench.load_state = LoadState::On;
        count(&mut bench, 3600.0, 0.0, 3.0, current_a);
        let state = bench.state;
        assert!(state.consumed_mah().expect("counted") > 2900.0);
        assert_eq!(state.readings.remaining_pct, Some(0.0), "{current_a:?}");
        assert_eq!(state.failsafe, FailsafeLevel::Critical);
    }
}

#[test]
fn of_a_count_and_a_current_the_larger_counts() {
    for (counted_a, measured_a) in [(2.2, 1.0), (1.0, 2.2)] {
        let mut bench = MonitorBench::new();
        bench.run(1.0, companion(0.0, Some(0.0)));
        bench.reset(100.0);
        count(&mut bench, 360.0, 0.0, counted_a, Some(measured_a));
        println!("{counted_a} A and {measured_a} A");
        assert_about(bench.state.readings.remaining_pct, 90.0, 1.5);
    }
}

#[test]
fn what_a_controller_counted_while_silent_is_drawn_when_it_returns_and_is_no_gap() {
    let reading = |soc: f32, charge_mah: f32, current_a| Measurement {
        counted: Some(Counted::Increment(Consumed {
            charge_mah,
            energy_wh: charge_mah * 0.012,
        })),
        current_a,
        ..volts(3.0 * Chemistry::LiPo.cell().curve.voltage_v(soc))
    };
    // Without a current, or without any reading.
    for (silent, tolerance_pct) in [
        (Ok(reading(1.0, 0.0, None)), 1.0),
        (Err(ReadError::Bus(BusError::NoAnswer)), 3.0),
    ] {
        let mut bench = MonitorBench::new();
        bench.run(1.0, reading(1.0, 0.01, Some(0.36)));
        bench.reset(100.0);
        for _ in 0..600 {
            bench.tick(silent);
        }
        bench.tick(Ok(reading(0.5, 1100.0, Some(0.36))));
        let state = bench.run(10.0, reading(0.5, 0.01, Some(0.36)));
        assert_about(state.readings.remaining_pct, 50.0, tolerance_pct);
        assert_about(state.consumed_mah(), 1101.0, 1.0);
        assert_about(state.consumed_wh, 1101.0 * 0.012, 0.1);
        let is_gap = |event: &PackEvent| matches!(event, PackEvent::Gap(_));
        assert!(!bench.events.iter().any(is_gap), "{:?}", bench.events);
    }
}

#[test]
// Requirement: S-10, L-12
fn a_count_that_falls_is_a_restart_of_its_source_and_no_charge() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, companion(0.0, Some(0.0)));
    bench.reset(100.0);
    count(&mut bench, 360.0, 0.0, 2.2, None);
    let before = bench.state;
    bench.tick(Ok(companion(0.0, None)));
    let state = bench.state;
    assert_eq!(state.consumed_mah(), before.consumed_mah());
    assert!(state.readings.remaining_pct <= before.readings.remaining_pct);
    count(&mut bench, 360.0, 220.0, 2.2, None);
    assert_about(bench.state.consumed_mah(), 440.0, 3.0);
    assert_about(bench.state.readings.remaining_pct, 80.0, 1.5);
}

#[test]
// Requirement: L-12
fn a_count_that_flickers_is_no_draw() {
    let mut bench = MonitorBench::new();
    for tick in 0..36_000 {
        bench.tick(Ok(companion(100.0 + (tick % 3) as f32, None)));
    }
    assert_eq!(bench.state.consumed_mah(), Some(102.0));
}

#[test]
fn a_count_that_stands_still_does_not_replace_an_unknown_current() {
    let (mut counted, mut plain) = (MonitorBench::new(), MonitorBench::new());
    for bench in [&mut counted, &mut plain] {
        bench.load_state = LoadState::On;
    }
    counted.run(300.0, companion(0.0, None));
    plain.run(300.0, volts(12.0));
    let without = plain.state.readings.remaining_pct;
    assert_eq!(counted.state.readings.remaining_pct, without);
}

#[test]
fn a_swapped_pack_has_none_of_the_count_of_the_one_before() {
    let mut bench = MonitorBench::new();
    let at = |voltage_v, total_mah| Measurement {
        voltage_v: Some(voltage_v),
        ..companion(total_mah, Some(0.0))
    };
    bench.run(5.0, at(10.2, 2000.0));
    assert!(bench.state.readings.remaining_pct.expect("known") < 10.0);
    bench.run(3.0, volts(0.3));
    let state = bench.run(10.0, at(12.5, 2000.0));
    assert!(bench.events.contains(&PackEvent::Swapped));
    assert_eq!(state.consumed_mah(), Some(0.0));
    assert!(state.readings.remaining_pct.expect("known") > 90.0);
}

#[test]
fn after_a_processor_reset_a_count_and_the_detected_cells_go_on() {
    let mut before = MonitorBench::new();
    before.settings.cell_count = None;
    before.run(5.0, companion(1000.0, Some(0.0)));
    // The companion has restarted.
    before.run(1.0, companion(0.0, Some(0.0)));
    count(&mut before, 60.0, 0.0, 6.0, None);
    let mut after = before.after_processor_reset();
    after.tick(Ok(companion(100.0, None)));
    assert_eq!(after.state.cell_count, Some(3));
    after.run(1.0, companion(100.0, None));
    assert_about(after.state.consumed_mah(), 1099.0, 2.0);
}

/// A pack at rest that reports its charge.
fn reports(soc: f32, cell_v: f32) -> Measurement {
    Measurement {
        state_of_charge: Some(soc),
        ..loaded(3.0 * cell_v, 0.0)
    }
}

#[test]
// Requirement: S-9
fn a_charge_that_the_resting_cells_contradict_is_announced_and_refuses_arming() {
    for chemistry in CHEMISTRIES {
        let mut bench = MonitorBench::new();
        bench.settings.chemistry = chemistry;
        let cell_v = chemistry.cell().lowest_resting_v(0.84) - 0.01;
        let nearly_empty = reports(0.84, cell_v);
        bench.run(11.0, nearly_empty);
        assert_eq!(
            bench.state.readings.faults,
            Faults::empty(),
            "not for long enough"
        );
        let state = bench.run(2.0, nearly_empty);
        assert_eq!(
            state.readings.faults,
            Faults::CONTRADICTED_CHARGE,
            "{chemistry:?}"
        );
        let announced = PackEvent::Faults(Faults::CONTRADICTED_CHARGE);
        assert!(bench.events.contains(&announced), "{chemistry:?}");
        // The charge that such cells have.
        let state = bench.run(13.0, reports(0.05, cell_v));
        assert_eq!(state.readings.faults, Faults::empty());
    }
}

#[test]
// Requirement: S-9
fn a_contradicted_charge_acts_on_no_rover_that_drives() {
    let mut bench = gauged_bench();
    bench.settings.failsafe.low.remaining_mah = Some(100.0);
    bench.settings.failsafe.critical.remaining_mah = None;
    let state = bench.run(60.0, reports(0.84, 3.5));
    assert_eq!(
        (state.readings.faults, state.failsafe),
        (Faults::empty(), FailsafeLevel::None)
    );
    bench.load_state = LoadState::Off;
    bench.run(15.0, reports(0.84, 3.5));
    bench.load_state = LoadState::On;
    let state = bench.run(60.0, reports(0.84, 3.5));
    assert_eq!(state.failsafe, FailsafeLevel::None);
    assert_ne!(state.charge_state, ChargeState::Unhealthy);
}

#[test]
fn one_cell_that_is_too_low_contradicts_the_charge() {
    let mut bench = MonitorBench::new();
    let uneven = Measurement {
        cells: CellVoltages::from_millivolts(&[3900, 3900, 3610]),
        ..reports(0.84, 3.8)
    };
    let expected = Faults::CONTRADICTED_CHARGE | Faults::CELL_DIFFERS;
    assert_eq!(bench.run(15.0, uneven).readings.faults, expected);
}

#[test]
// Requirement: S-9, AP-18
fn a_percentage_below_the_charge_of_the_resting_cells_is_announced_and_does_not_act() {
    let mut bench = gauged_bench();
    bench.settings.failsafe.low = Thresholds {
        usable_pct: Some(15.0),
        ..Thresholds::default()
    };
    bench.settings.failsafe.critical = Thresholds::default();
    bench.load_state = LoadState::Off;
    let cell_v = bench.settings.chemistry.cell().highest_resting_v(0.05) + 0.01;
    bench.run(15.0, reports(0.05, cell_v));
    let faults = PackEvent::Faults(Faults::UNDERSTATED_CHARGE);
    assert!(bench.events.contains(&faults), "{:?}", bench.events);
    assert!(!bench.state.readings.faults.contains(Faults::CONTRADICTED_CHARGE));
    bench.load_state = LoadState::On;
    let state = bench.run(60.0, reports(0.05, cell_v));
    assert_eq!(state.failsafe, FailsafeLevel::None);
    // Cells that may have it.
    let low_v = bench.settings.chemistry.cell().highest_resting_v(0.05) - 0.01;
    bench.load_state = LoadState::Off;
    bench.run(15.0, reports(0.05, low_v));
    bench.load_state = LoadState::On;
    let state = bench.run(60.0, reports(0.05, low_v));
    assert_eq!(state.failsafe, FailsafeLevel::Low);
}

#[test]
fn no_sound_cell_contradicts_its_charge() {
    for chemistry in CHEMISTRIES {
        let cell = chemistry.cell();
        for percent in 0..=100 {
            let soc = percent as f32 / 100.0;
            let mut bench = MonitorBench::new();
            bench.settings.chemistry = chemistry;
            // Of the lowest or highest make, with a gauge that is 5 % off.
            for sign in [-1.0, 1.0] {
                let charge = (soc + 0.05 * sign).clamp(0.0, 1.0);
                let cell_v = cell.curve.voltage_v(charge) + sign * cell.lowest_make_v;
                let faults = bench.run(15.0, reports(soc, cell_v)).readings.faults;
                assert!(
                    !faults.intersects(Faults::CONTRADICTIONS),
                    "{chemistry:?} {percent} %"
                );
            }
        }
    }
}

#[test]
// Requirement: L-12
fn packs_of_a_sum_that_rest_apart_are_a_fault_on_which_nothing_acts() {
    let sum = |spread| Measurement {
        members: 0b110,
        members_spread: spread,
        ..loaded(11.5, 0.0)
    };
    let mut bench = MonitorBench::new();
    bench.run(5.0, sum(Some(0.04)));
    assert_eq!(bench.state.readings.faults, Faults::empty());
    let state = bench.run(2.0, sum(Some(0.06)));
    assert_eq!(state.readings.faults, Faults::INCOMPATIBLE_VOLTAGE);
    assert_eq!(bench.events, [PackEvent::Faults(Faults::INCOMPATIBLE_VOLTAGE)]);
    assert_eq!(state.charge_state, ChargeState::Ok);
    // Under load the last rest counts.
    let faults = bench.run(5.0, sum(None)).readings.faults;
    assert_eq!(faults, Faults::INCOMPATIBLE_VOLTAGE);
}

#[test]
fn a_sum_has_the_capacity_of_its_packs_unless_its_own_is_set() {
    let sum = |capacity_mah| Measurement {
        members: 0b110,
        members_capacity_mah: capacity_mah,
        ..loaded(11.5, 0.0)
    };
    for (own_mah, members_mah, expected_mah) in [
        (None, Some(5000.0), Some(5000.0)),
        (None, None, None),
        (Some(4000.0), Some(5000.0), Some(4000.0)),
    ] {
        let mut bench = MonitorBench::new();
        bench.settings.capacity_mah = own_mah;
        bench.run(5.0, sum(members_mah));
        assert_eq!(bench.state.capacity_mah(), expected_mah);
        bench.reset(50.0);
        bench.run(0.1, sum(members_mah));
        let half_mah = expected_mah.map_or(0.0, |capacity_mah| capacity_mah / 2.0);
        assert_eq!(bench.state.consumed_mah(), Some(half_mah));
    }
}

#[test]
fn a_reset_and_the_time_left_are_of_what_the_pack_holds_now() {
    let learnt = "cells 3\ndrives 1\ncapacity_mah_sigma 1800 0.03\nresistance_ohm_now_first 0.02 0.02\n";
    let mut bench = MonitorBench::new();
    bench.monitor.restore_learnt(learnt.parse().expect("a pack"));
    bench.run(5.0, loaded(11.5, 3.6));
    bench.reset(50.0);
    let state = bench.run(1.0, loaded(11.5, 3.6));
    assert_about(state.consumed_mah(), 901.0, 0.5);
    assert_about(state.remaining(), 899.0, 2.0);
    assert_about(state.readings.time_remaining_s, 900.0, 10.0);
}

#[test]
fn another_pack_and_detected_cells_are_another_revision() {
    let mut bench = MonitorBench::new();
    bench.settings.cell_count = None;
    bench.run(5.0, loaded(10.2, 0.0));
    assert_eq!(bench.state.revision, 1);
    bench.run(3.0, loaded(0.3, 0.0));
    bench.run(2.2, loaded(12.4, 0.0));
    assert!(bench.events.contains(&PackEvent::Swapped));
    assert!(bench.state.revision >= 2);
}
