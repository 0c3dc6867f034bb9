//! Parameters of the measurements that change while a pack is connected, and between its drives.

use super::rover::{IDLE_A, Pack, Rover, STEEP, Sensors, TRUE_SCALE};
use super::*;
use crate::MeasuringScale;
use crate::learnt::{LearntCapacity, LearntResistance, Offset};

fn multiplied(volt_multiplier: f32) -> MeasuringScale {
    MeasuringScale {
        volt_multiplier,
        ..TRUE_SCALE
    }
}

/// A rover that has found its pack by a wrong multiplier.
fn uncalibrated(chemistry: Chemistry, soc: f32, volt_multiplier: f32, sensors: Sensors) -> Rover {
    let mut rover = Rover::with(Pack::rested(chemistry, soc));
    rover.sensors = sensors;
    rover.measuring.scale = multiplied(volt_multiplier);
    rover.run(200.0, IDLE_A);
    rover
}

#[test]
// Requirement: S-7, PX-6
fn a_calibration_at_rest_restarts_the_estimate() {
    for chemistry in STEEP {
        for sensors in [Sensors::VoltageAndCurrent, Sensors::Voltage] {
            for (volt_multiplier, soc) in [(4.1, 0.6), (4.1, 0.3), (3.8, 0.6), (3.8, 0.9)] {
                let mut rover = uncalibrated(chemistry, soc, volt_multiplier, sensors);
                let what = format!("{chemistry:?} {sensors:?} {soc} by {volt_multiplier}");
                let error_pct = rover.error_pct();
                assert!(error_pct.abs() > 8.0, "{what}: off by {error_pct} %");
                rover.measuring.scale = TRUE_SCALE;
                rover.run(65.0, IDLE_A);
                rover.assert_error_below(5.0, &what);
                assert_eq!(rover.restarts(), 1, "{what}");
                let kept = rover.kept_charge().expect("kept at the rest");
                assert!((kept - rover.pack.soc).abs() < 0.05, "{what}: {kept} kept");
            }
        }
    }
}

#[test]
// Requirement: S-7
fn a_calibration_under_way_waits_for_a_rest() {
    let mut rover = uncalibrated(Chemistry::LiIon, 0.8, 4.1, Sensors::VoltageAndCurrent);
    let before = rover.kept_charge();
    rover.bench.load_state = LoadState::On;
    rover.run(10.0, 2.2);
    rover.measuring.scale = TRUE_SCALE;
    rover.run(20.0, 2.2);
    assert_eq!(rover.restarts(), 0);
    rover.bench.load_state = LoadState::Off;
    rover.run(1.0, IDLE_A);
    assert_ne!(before, None);
    assert_eq!(rover.kept_charge(), None, "a rest of another scale");
    rover.run(100.0, IDLE_A);
    assert_eq!(rover.restarts(), 1);
    rover.assert_error_below(5.0, "after the rest");
}

#[test]
// Requirement: S-7
fn another_pin_or_offset_is_another_scale() {
    let pin = |measuring: &mut Measuring| measuring.voltage_pin = 27;
    let offset = |measuring: &mut Measuring| measuring.scale.volt_offset_v = 0.05;
    let changes: [fn(&mut Measuring); 2] = [pin, offset];
    for (number, change) in changes.into_iter().enumerate() {
        let mut rover = Rover::parked(Pack::rested(Chemistry::LiPo, 0.5));
        change(&mut rover.measuring);
        rover.run(10.0, IDLE_A);
        assert_eq!(rover.restarts(), 1, "{number}");
    }
}

#[test]
// Requirement: S-7
fn small_changes_count_together() {
    let mut rover = Rover::parked(Pack::rested(Chemistry::LiPo, 0.6));
    // 10 mV of a cell each.
    for (step, restarts) in [(1.0, 0), (2.0, 1), (3.0, 1), (4.0, 2)] {
        rover.measuring.scale = multiplied(3.95 * (1.0 - 0.0026 * step));
        rover.run(30.0, IDLE_A);
        assert_eq!(rover.restarts(), restarts, "{step}");
    }
}

#[test]
// Requirement: S-7
fn on_a_flat_curve_a_count_is_doubted_and_goes_on() {
    let mut rover = uncalibrated(Chemistry::LiFe, 1.0, 4.0, Sensors::VoltageAndCurrent);
    // Relaxed it is certain.
    rover.run(4.0 * 3600.0, 0.0);
    rover.drive_to(0.6);
    rover.run(60.0, IDLE_A);
    let sigma_pct = |rover: &Rover| rover.bench.state.readings.remaining_sigma_pct.expect("known");
    let (before_pct, before_sigma_pct) = (rover.reported_pct(), sigma_pct(&rover));
    rover.measuring.scale = TRUE_SCALE;
    rover.run(60.0, IDLE_A);
    assert_eq!(rover.restarts(), 0);
    let what = format!(
        "{before_pct} ± {before_sigma_pct} %, then {} ± {} %",
        rover.reported_pct(),
        sigma_pct(&rover)
    );
    assert!((rover.reported_pct() - before_pct).abs() < 2.0, "{what}");
    assert!(before_sigma_pct < 5.0 && sigma_pct(&rover) > 10.0, "{what}");
}

#[test]
// Requirement: S-7
fn another_source_of_the_current_ends_a_gap_and_a_count_below_zero() {
    let mut bench = MonitorBench::new();
    bench.monitor.follow_current(1);
    bench.run(10.0, loaded(12.0, 3.6));
    let before_mah = bench.state.consumed_mah().expect("counted");
    // Read by the wrong offset, not at all, and by the right one.
    for _ in 0..200 {
        bench.tick(Err(ReadError::NoPin));
    }
    bench.monitor.follow_current(2);
    bench.run(0.1, loaded(12.0, 0.0));
    assert_about(bench.state.consumed_mah(), before_mah, 0.1);
    // Driven in reverse, as its sensor has it.
    bench.load_state = LoadState::On;
    for _ in 0..40 {
        bench.run(3.0, loaded(11.6, -8.0));
        bench.run(3.0, loaded(11.9, -1.0));
    }
    assert_eq!(bench.count_of(PackEvent::CurrentReversed), 1);
    assert!(bench.state.consumed_mah().expect("counted") < -100.0);
    bench.monitor.follow_current(3);
    bench.run(10.0, loaded(11.9, 3.6));
    assert_about(bench.state.consumed_mah(), 10.0, 0.2);
    // A charger has brought it below: that is its count.
    bench.run(20.0, loaded(11.9, -3.6));
    bench.monitor.follow_current(4);
    bench.run(0.1, loaded(11.9, 0.0));
    assert_about(bench.state.consumed_mah(), -10.0, 0.2);
}

fn learnt(scale: Option<MeasuringScale>) -> LearntPack {
    LearntPack {
        chemistry: Chemistry::LiPo,
        cell_count: 3,
        drives: 4,
        capacity: Some(LearntCapacity {
            capacity_mah: 2000.0,
            sigma: 0.03,
            seen_mah: 2100.0,
            seen_sigma: 0.03,
        }),
        resistance: Some(LearntResistance {
            now_ohm: 0.02,
            first_ohm: 0.016,
        }),
        offsets: [Offset::from_v(0.02, 0.01); 5],
        scale,
        ..LearntPack::UNKNOWN
    }
}

/// The knowledge of a rover that has measured by `scale` and kept `learnt`.
fn known_of(learnt: LearntPack, scale: MeasuringScale) -> LearntPack {
    let mut rover = Rover::with(Pack::rested(Chemistry::LiPo, 0.6));
    rover.bench.monitor.restore_learnt(learnt);
    rover.measuring.scale = scale;
    rover.run(1.0, IDLE_A);
    assert_eq!(rover.bench.monitor.unsaved_learnt(), None);
    *rover.bench.monitor.learnt().expect("restored")
}

#[test]
// Requirement: S-7
fn what_was_learnt_under_another_scale_is_converted() {
    let before = learnt(Some(TRUE_SCALE));
    let changed = MeasuringScale {
        volt_multiplier: 4.345,
        amperes_per_volt: 34.0,
        ..TRUE_SCALE
    };
    let known = known_of(before, changed);
    assert_eq!(known.capacity_mah(), Some(4000.0));
    assert_eq!(known.capacity.expect("learnt").seen_mah, 4200.0);
    let ohm = known.resistance.expect("learnt");
    assert!(
        (ohm.now_ohm / 0.011 - 1.0).abs() < 1e-3 && (ohm.first_ohm / 0.0088 - 1.0).abs() < 1e-3,
        "{ohm:?}"
    );
    assert!(!known.has_curve());
    assert_eq!((known.drives, known.scale), (4, Some(changed)));
    // The current alone says nothing of the curve.
    let reversed = MeasuringScale {
        amperes_per_volt: -34.0,
        ..TRUE_SCALE
    };
    let known = known_of(before, reversed);
    assert_eq!(
        (known.capacity_mah(), known.offsets),
        (Some(4000.0), before.offsets)
    );
    // A scale within the error of a voltage, and a factor of zero, change nothing.
    for scale in [
        multiplied(3.955),
        MeasuringScale {
            amperes_per_volt: 0.0,
            ..TRUE_SCALE
        },
    ] {
        assert_eq!(known_of(before, scale), before);
    }
}

#[test]
// Requirement: S-7
fn a_record_without_a_scale_is_of_the_present_one() {
    let known = known_of(learnt(None), TRUE_SCALE);
    assert_eq!(known, learnt(Some(TRUE_SCALE)));
}
