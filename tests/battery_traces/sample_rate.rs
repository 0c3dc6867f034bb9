//! How often a pack is sampled must not change what is said of it.

use rover_battmon::battery::PackSettings;

use crate::pack::{Pack, samples};
use crate::replay::{Moment, run, without_current};

const RATES_HZ: [u32; 3] = [5, 10, 50];
const DURATION_S: f64 = 500.0;

/// How far the estimates of the rates are apart at any of the times they have in common, in percent of the charge.
fn largest_difference_pct(settings: &PackSettings, measures_current: bool) -> f64 {
    let [slow, middle, fast] = RATES_HZ.map(|rate_hz| {
        let samples = samples(Pack::at(0.9), rate_hz, DURATION_S);
        let samples = if measures_current {
            samples
        } else {
            without_current(&samples)
        };
        let moments = run(&samples, settings).into_iter();
        let common = moments.step_by((rate_hz / RATES_HZ[0]) as usize);
        common.collect::<Vec<Moment>>()
    });
    let mut largest_pct: f64 = 0.0;
    let mut compared = 0;
    for ((slow, middle), fast) in slow.iter().zip(&middle).zip(&fast) {
        assert!((slow.t_s - fast.t_s).abs() < 1e-6 && (slow.t_s - middle.t_s).abs() < 1e-6);
        let all = [slow, middle, fast].map(Moment::remaining_pct);
        let [Some(slow_pct), Some(middle_pct), Some(fast_pct)] = all else {
            continue;
        };
        compared += 1;
        let highest = slow_pct.max(middle_pct).max(fast_pct);
        let lowest = slow_pct.min(middle_pct).min(fast_pct);
        largest_pct = largest_pct.max(highest - lowest);
    }
    assert!(compared > 2400, "only {compared} times have an estimate");
    largest_pct
}

#[test]
fn the_charge_is_the_same_at_5_10_and_50_hz() {
    let cells = PackSettings {
        cell_count: Some(3),
        ..PackSettings::default()
    };
    let capacity = PackSettings {
        capacity_mah: Some(2200.0),
        ..cells
    };
    for (name, settings, measures_current) in [
        ("current and capacity", capacity, true),
        ("current without capacity", cells, true),
        ("voltage only", cells, false),
    ] {
        let difference_pct = largest_difference_pct(&settings, measures_current);
        println!("5, 10 and 50 Hz, {name}: {difference_pct:.3} % apart");
        assert!(difference_pct <= 0.3, "{name}: {difference_pct} %");
    }
}
