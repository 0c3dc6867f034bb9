//! Estimates do not depend on the sample rate.

use rover_battmon::battery::{BatteryMonitor, BatteryState, PackSettings};
use rover_battmon::vehicle::ArmState;

use super::pack::{Pack, samples};
use super::replay::{Moment, cells_and_capacity_set, cells_set, run_from, without_current};

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
            monitor.reset(&mut BatteryState::default(), ArmState::Armed, 100.0, settings);
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
