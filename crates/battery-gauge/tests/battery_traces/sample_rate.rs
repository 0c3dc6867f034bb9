//! Estimates do not depend on the sample rate.

use battery_gauge::{BatteryMonitor, BatteryState, LoadState, PackSettings};

use super::pack::{Pack, samples};
use super::replay::{Moment, Sample, cells_and_capacity_set, cells_set, run_from, without_current};

const RATES_HZ: [u32; 3] = [5, 10, 50];
const DURATION_S: f64 = 500.0;

/// Initial condition of the monitor.
#[derive(Clone, Copy, Debug)]
enum Start {
    /// Boot at standstill.
    AtRest,
    /// Boot during a drive.
    UnderLoad,
    /// Battery reset to full of a pack that is not.
    WrongReset,
}

impl Start {
    /// Times of boot and of the first comparison, in seconds. Under load the first estimate takes a minute; a wrong
    /// reset is corrected after two, at one of the next blocks of ten seconds.
    fn times_s(self) -> (f64, f64) {
        match self {
            Self::AtRest => (0.0, 0.0),
            Self::UnderLoad => (34.0, 104.0),
            Self::WrongReset => (0.0, 144.0),
        }
    }

    /// Tolerated difference, in percent of the charge.
    fn tolerance_pct(self) -> f64 {
        match self {
            Self::AtRest | Self::UnderLoad => 0.6,
            // The voltage of another block restarts the estimate.
            Self::WrongReset => 2.0,
        }
    }

    fn monitor(self, settings: &PackSettings) -> BatteryMonitor {
        let mut monitor = BatteryMonitor::new();
        if let Self::WrongReset = self {
            monitor.reset(&mut BatteryState::default(), LoadState::On, 100.0, settings);
        }
        monitor
    }
}

/// Maximum difference between the estimates of the sample rates at common times, in percent of the charge.
fn largest_difference_pct(settings: &PackSettings, measures_current: bool, start: Start) -> f64 {
    let (on_s, compare_from_s) = start.times_s();
    let [slow, middle, fast] = RATES_HZ.map(|rate_hz| {
        let mut samples = samples(Pack::at(0.9), rate_hz, DURATION_S);
        samples.retain(|sample| sample.t_s >= on_s);
        let samples = if measures_current {
            samples
        } else {
            without_current(&samples)
        };
        let moments = run_from(start.monitor(settings), &samples, settings).into_iter();
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
        if slow.t_s < compare_from_s {
            continue;
        }
        compared += 1;
        let highest = slow_pct.max(middle_pct).max(fast_pct);
        let lowest = slow_pct.min(middle_pct).min(fast_pct);
        largest_pct = largest_pct.max(highest - lowest);
    }
    assert!(compared > 1700, "only {compared} times have an estimate");
    largest_pct
}

#[test]
// Requirement: OWN-1
fn charge_is_the_same_at_5_10_and_50_hz() {
    let (cells, capacity) = (cells_set(), cells_and_capacity_set());
    for (name, settings, measures_current, start) in [
        ("current and capacity", capacity, true, Start::AtRest),
        ("current and capacity", capacity, true, Start::UnderLoad),
        ("current and capacity", capacity, true, Start::WrongReset),
        ("current without capacity", cells, true, Start::AtRest),
        ("voltage only", cells, false, Start::AtRest),
    ] {
        let difference_pct = largest_difference_pct(&settings, measures_current, start);
        println!("5, 10 and 50 Hz, {name}, {start:?}: {difference_pct:.3} % apart");
        assert!(
            difference_pct <= start.tolerance_pct(),
            "{name}, {start:?}: {difference_pct} %"
        );
    }
}

/// The means of these samples over periods of `period_s` seconds, each at the end of its period.
fn means(samples: &[Sample], period_s: u32) -> Vec<Sample> {
    let periods = samples[1..].chunks_exact((50 * period_s) as usize);
    let mean = |period: &[Sample], value: fn(&Sample) -> f64| {
        let values = period.iter().map(value);
        values.sum::<f64>() / period.len() as f64
    };
    periods
        .map(|period| {
            let voltage_v = mean(period, |sample| f64::from(sample.voltage_v));
            let current_a = mean(period, |sample| f64::from(sample.current_a.expect("measured")));
            let last = period[period.len() - 1];
            Sample::measured(last.t_s, voltage_v, current_a, last.armed)
        })
        .collect()
}

#[test]
fn a_mean_each_second_or_each_ten_seconds_is_enough() {
    let settings = cells_and_capacity_set();
    let fast = samples(Pack::at(0.9), 50, DURATION_S);
    let last = |samples: &[Sample]| {
        let moments = run_from(BatteryMonitor::new(), samples, &settings);
        moments[moments.len() - 1].remaining_pct().expect("known")
    };
    let of_fast_pct = last(&fast);
    for period_s in [1, 5, 10] {
        let remaining_pct = last(&means(&fast, period_s));
        println!("each {period_s} s: {remaining_pct:.1} %, at 50 Hz {of_fast_pct:.1} %");
        assert!(
            (remaining_pct - of_fast_pct).abs() < 1.0,
            "each {period_s} s: {remaining_pct} %"
        );
    }
}
