//! Errors of consumption and state of charge.

use battery_gauge::{PackEvent, PackSettings};

use super::pack::{Pack, charging, samples};
use super::replay::{
    Moment, Sample, cells_and_capacity_set, cells_set, drawn_mah, root_mean_square, run, trace,
    without_current,
};

const DISCHARGE: &str = "trace_discharge_3s_10min.csv";
const CAPACITY_MAH: f64 = 2200.0;

/// True remaining charge after each sample of the discharge from full, in percent.
fn truth_pct(samples: &[Sample]) -> Vec<f64> {
    let remaining_pct = |drawn_mah: f64| 100.0 * (1.0 - drawn_mah / CAPACITY_MAH);
    drawn_mah(samples).into_iter().map(remaining_pct).collect()
}

fn disarmed(mut samples: Vec<Sample>) -> Vec<Sample> {
    samples.iter_mut().for_each(|sample| sample.armed = false);
    samples
}

/// RMS error, in percent of the charge, and the number of samples with an estimate.
fn rms_error_pct(moments: &[Moment], truth_pct: &[f64]) -> (f64, usize) {
    let errors: Vec<f64> = moments
        .iter()
        .zip(truth_pct)
        .filter_map(|(moment, truth_pct)| Some(moment.remaining_pct()? - truth_pct))
        .collect();
    (root_mean_square(&errors), errors.len())
}

#[test]
// Requirement: OWN-1
fn charge_by_voltage_alone_is_within_5_percent() {
    let samples = trace(DISCHARGE);
    let truth_pct = truth_pct(&samples);
    let detected = PackEvent::CellsDetected { count: 3 };
    let armed = without_current(&samples);
    // Disarmed, standing still between loads is not a rest whose voltage is believed.
    for (seen, settings, detects) in [
        (disarmed(armed.clone()), cells_set(), false),
        (armed.clone(), cells_set(), false),
        (armed, PackSettings::default(), true),
    ] {
        let moments = run(&seen, &settings);
        let (rms_pct, count) = rms_error_pct(&moments, &truth_pct);
        let states = moments.windows(2);
        let changes = states.filter(|pair| pair[0].state.charge_state != pair[1].state.charge_state);
        let changes = changes.count();
        println!("voltage only: {rms_pct:.2} % rms, {changes} changes of charge_state");
        assert!(
            count > samples.len() * 9 / 10,
            "only {count} samples have an estimate"
        );
        assert!(rms_pct <= 5.0, "{rms_pct} % rms");
        assert!(changes <= 2, "{changes} changes");
        let events = moments.iter().flat_map(|moment| &moment.events);
        let times = events.filter(|event| **event == detected).count();
        assert_eq!(times, usize::from(detects), "cells are detected once");
    }
}

#[test]
fn a_gap_of_two_minutes_costs_a_few_percent() {
    let samples = trace(DISCHARGE);
    let truth = truth_pct(&samples);
    let (seen, truth): (Vec<Sample>, Vec<f64>) = samples
        .iter()
        .zip(truth)
        .filter(|(sample, _)| !(200.0..320.0).contains(&sample.t_s))
        .unzip();
    let (rms_pct, _) = rms_error_pct(&run(&seen, &cells_and_capacity_set()), &truth);
    println!("a gap of two minutes: {rms_pct:.2} % rms");
    assert!(rms_pct <= 3.0, "{rms_pct} % rms");
}

#[test]
// Requirement: OWN-1
fn charge_by_current_and_capacity_is_within_1_percent() {
    let samples = trace(DISCHARGE);
    let moments = run(&samples, &cells_and_capacity_set());
    let (rms_pct, count) = rms_error_pct(&moments, &truth_pct(&samples));
    println!("current and capacity: {rms_pct:.2} % rms");
    // The first estimate takes a quarter of a second.
    assert_eq!(count, samples.len() - 3);
    assert!(rms_pct <= 1.0, "{rms_pct} % rms");
}

#[test]
// Requirement: OWN-1
fn charge_from_boot_in_mid_drive_is_within_8_percent() {
    let samples = trace(DISCHARGE);
    let truth = truth_pct(&samples);
    let error_from = |start: usize| {
        let moments = run(&samples[start..], &cells_and_capacity_set());
        rms_error_pct(&moments, &truth[start..]).0
    };
    for start_s in (50..600).step_by(50) {
        println!("started at {start_s} s: {:.2} % rms", error_from(start_s * 10));
    }
    let rms_pct = error_from(3000);
    assert!(rms_pct <= 8.0, "{rms_pct} % rms");
}

#[test]
// Requirement: OWN-1, AP-15
fn consumption_is_the_integral_of_current_and_power() {
    let samples = trace(DISCHARGE);
    let expected_mah = *drawn_mah(&samples).last().unwrap();
    let energy_wh = |pair: &[Sample]| {
        let power_w = f64::from(pair[1].voltage_v * pair[1].current_a.unwrap());
        power_w * (pair[1].t_s - pair[0].t_s) / 3600.0
    };
    let expected_wh: f64 = samples.windows(2).map(energy_wh).sum();
    let moments = run(&samples, &cells_and_capacity_set());
    let last = &moments.last().unwrap().state;
    let consumed_mah = f64::from(last.consumed_mah().expect("consumption"));
    let consumed_wh = f64::from(last.consumed_wh.expect("energy"));
    for (consumed, expected) in [(consumed_mah, expected_mah), (consumed_wh, expected_wh)] {
        let error = (consumed / expected - 1.0).abs();
        println!("consumption: {consumed:.4}, {:.5} % off", error * 100.0);
        assert!(error <= 5e-5, "{consumed} instead of {expected}");
    }
}

#[test]
fn half_full_pack_is_not_estimated_full() {
    let half_full = samples(Pack::at(0.5), 10, 60.0);
    for (samples, settings) in [
        (half_full.clone(), cells_and_capacity_set()),
        (without_current(&half_full), cells_set()),
        (without_current(&half_full), PackSettings::default()),
    ] {
        let moments = run(&samples, &settings);
        let last_pct = moments.last().unwrap().remaining_pct().expect("an estimate");
        println!("half full: {last_pct:.1} %");
        assert!((35.0..65.0).contains(&last_pct), "{last_pct} %");
        let highest_pct = moments
            .iter()
            .filter_map(Moment::remaining_pct)
            .fold(0.0, f64::max);
        assert!(highest_pct < 65.0, "{highest_pct} %");
    }
}

/// Number of load drops by more than 5 A within a second, and the largest rise of the estimate within 30 s after one.
fn largest_rebound_pct(samples: &[Sample], moments: &[Moment]) -> (usize, f64) {
    let mut largest_pct: f64 = 0.0;
    let mut ends = 0;
    for end in 10..samples.len() {
        let load_a = |sample: usize| samples[sample].current_a.expect("a current");
        let before = &moments[end - 10];
        let (Some(before_pct), true) = (before.remaining_pct(), load_a(end - 10) - load_a(end) > 5.0) else {
            continue;
        };
        ends += 1;
        let after = moments[end..]
            .iter()
            .take_while(|moment| moment.t_s <= before.t_s + 30.0);
        let highest_pct = after.filter_map(Moment::remaining_pct).fold(0.0, f64::max);
        largest_pct = largest_pct.max(highest_pct - before_pct);
    }
    (ends, largest_pct)
}

#[test]
// Requirement: OWN-1
fn estimate_does_not_rise_when_a_load_ends() {
    for (name, samples) in [
        (DISCHARGE, trace(DISCHARGE)),
        ("a drive with stops", samples(Pack::at(0.8), 10, 500.0)),
    ] {
        for (fed, settings) in [
            (samples.clone(), cells_and_capacity_set()),
            (without_current(&samples), cells_set()),
        ] {
            let (ends, rise_pct) = largest_rebound_pct(&samples, &run(&fed, &settings));
            println!("{name}: rises by {rise_pct:.2} % at most");
            assert!(ends > 20, "only {ends} samples at the end of a load");
            assert!(rise_pct <= 0.5, "{name}: {rise_pct} %");
        }
    }
}

#[test]
fn a_pack_charged_in_place_is_full_whatever_its_label() {
    for capacity_mah in [1800.0, 2200.0, 2800.0] {
        let settings = PackSettings {
            capacity_mah: Some(capacity_mah),
            ..cells_set()
        };
        let moments = run(&charging(Pack::at(0.4), 10), &settings);
        let last_pct = moments.last().unwrap().remaining_pct().expect("an estimate");
        println!("charged, label {capacity_mah}: {last_pct:.1} %");
        assert!(last_pct > 99.0, "label {capacity_mah}: {last_pct} %");
    }
}

/// The time left where the current is not measured, relative to the true one at the mean load so far, and how long after the
/// start of the load, in seconds. It is known from some moment on.
fn times_left(samples: &[Sample], settings: &PackSettings) -> Vec<(f64, f64)> {
    let moments = run(&without_current(samples), settings);
    let drawn = drawn_mah(samples);
    let loaded_s = samples
        .iter()
        .find(|sample| sample.current_a.is_some_and(|current_a| current_a > 1.0))
        .expect("a load")
        .t_s;
    let is_known: Vec<bool> = moments
        .iter()
        .map(|moment| moment.state.readings.time_remaining_s.is_some())
        .collect();
    let changes = is_known.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert_eq!(changes, 1, "it flickers");
    let known = moments.iter().zip(&drawn).filter_map(|(moment, drawn_mah)| {
        let left_s = f64::from(moment.state.readings.time_remaining_s?);
        let since_s = moment.t_s - loaded_s;
        let true_s = (CAPACITY_MAH - drawn_mah) / drawn_mah * since_s;
        Some((since_s, left_s / true_s))
    });
    known.collect()
}

#[test]
fn time_left_without_a_current_is_known_once_the_load_has_settled() {
    let mut parked = samples(Pack::at(1.0), 10, 1000.0);
    // Armed, and at a standstill for ten minutes before the drive.
    let first = parked[0];
    parked.iter_mut().for_each(|sample| sample.t_s += 600.0);
    let standstill = (0..6000).map(|tick| Sample {
        t_s: f64::from(tick) * 0.1,
        armed: true,
        ..first
    });
    let parked: Vec<Sample> = standstill.chain(parked).collect();
    let mut ending_at_9_v = cells_set();
    ending_at_9_v.failsafe.timer_s = Some(10.0);
    ending_at_9_v.failsafe.critical.voltage_v = Some(9.0);
    for (name, samples) in [
        (DISCHARGE, trace(DISCHARGE)),
        ("the same, disarmed", disarmed(trace(DISCHARGE))),
        ("a drive with stops", samples(Pack::at(1.0), 10, 1000.0)),
        ("the same, parked before", parked),
    ] {
        let times = times_left(&samples, &ending_at_9_v);
        let (first_s, last_s) = (times[0].0, times[times.len() - 1].0);
        let ratios = times.iter().map(|(_, ratio)| *ratio);
        let (lowest, highest) = (
            ratios.clone().fold(f64::INFINITY, f64::min),
            ratios.fold(0.0, f64::max),
        );
        println!(
            "time left, {name}: known from {first_s:.0} s to {last_s:.0} s, {lowest:.2} to {highest:.2} of the true one"
        );
        assert!(
            (110.0..135.0).contains(&first_s),
            "{name}: known from {first_s} s"
        );
        assert!(lowest >= 0.6 && highest <= 1.0, "{name}: {lowest} to {highest}");
    }
}
