//! A challenger of the crate's estimator: one Gaussian a pack, over charge, capacity, resistance, slow parts of the sag, its growth
//! towards empty, and this cell's deviation from the chemistry's curve. Each block of ten seconds is one prediction and one
//! correction by its mean voltage. A start is a few hypotheses: found full, as it was left, or anywhere; label right or wrong.
//!
//! It would replace the crate's estimator if it were nearer to the goals in twice as many figures as it is farther in, and in none
//! farther by more than 2 (points, per cent, minutes or tenths of a share; less than 0.5 does not count). With recordings it is
//! nearer in 68 figures, farther in 36, and in 18 of these by more than 2, so it does not:
//! - sensors that are wrong for one drive: 16 points off in the third drive after an offset, 30 after a current that saturated;
//! - a label that is 20 % high, on the second drive: 4 to 5 points, where the crate has 1;
//! - drives of three minutes: LiFe's capacity is 30 % off after two weeks;
//! - thirty equal drives at −20 °C: 27 % off, where the crate has 15 % at most;
//! - an aged LiCoO2 pack, drawn far below empty: 1 mV of noise moves it by 6 points.
//!
//! It is better from full with other makes, on aged packs (0.9 points at 24 °C and 7 at 4 °C, where the crate has 6 and 22),
//! in its stated deviations, and for the usable charge of the first cell from 25 to 10 °C (1.5 points instead of 5 to 7).
//!
//! Without a current sensor, it is the crate's estimator. Constants are those of a prototype, if nothing else is noted.

mod block;
mod cell;
mod covariance;
mod hypotheses;
mod kept;
mod kinds;
mod power_cycle;
mod predict;
mod states;
mod update;
mod usable;

use battery_gauge::PackSettings;
use fastrand::Rng;

use crate::estimator::{Estimator, Monitor, Report};
use crate::sample::Sample;
use crate::simulated::{CHEMICALS, Chemical, Pack, deviation};
use cell::Cell;
use kept::Kept;
use kinds::Kind;
use power_cycle::PowerCycle;

/// The crate's deviation by voltage alone is too narrow by this factor: chosen on simulated packs. In percent, it stays known.
const ALONE_WIDER: f32 = 2.0;
const MOST_SIGMA_PCT: f32 = 25.0;

/// One Gaussian a pack over charge, capacity, resistance, sag and this cell's curve.
#[derive(Clone, Default)]
pub struct Challenger {
    settings: PackSettings,
    kept: Option<Kept>,
    cycle: Option<PowerCycle>,
    /// Of a pack whose current is not measured.
    alone: Option<Box<Monitor>>,
    before_s: f64,
}

impl Challenger {
    /// What flash would hold if power went off now.
    fn kept(&self) -> Option<Kept> {
        let kept = self.kept.as_ref()?;
        let teacher = self.cycle.as_ref().filter(|cycle| cycle.teaches());
        Some(teacher.map_or_else(|| kept.clone(), |cycle| kept.after(cycle)))
    }

    fn cell(&self) -> Cell {
        let label_ah = f64::from(self.settings.capacity_mah.expect("a label")) / 1000.0;
        let critical_v = self.settings.failsafe.critical.voltage_v.map_or(0.0, f64::from);
        Cell::new(
            Kind::of(self.settings.chemistry),
            label_ah,
            critical_v / self.cells(),
        )
    }

    /// The crate's estimate, with more doubt.
    fn by_voltage_alone(&mut self, sample: &Sample) -> Report {
        let settings = self.settings;
        let monitor = self.alone.get_or_insert_with(|| {
            let mut monitor = Box::<Monitor>::default();
            monitor.start(&settings);
            monitor
        });
        let report = monitor.update(sample);
        let widened = |sigma_pct: f32| (ALONE_WIDER * sigma_pct).min(MOST_SIGMA_PCT);
        Report {
            sigma_pct: report.sigma_pct.map(widened),
            ..report
        }
    }

    fn cells(&self) -> f64 {
        f64::from(self.settings.cell_count.unwrap_or(1))
    }
}

impl Estimator for Challenger {
    const NAME: &'static str = "challenger";

    fn start(&mut self, settings: &PackSettings) {
        let kept = self.kept();
        self.settings = *settings;
        self.cycle = None;
        self.alone = None;
        let cell = self.cell();
        self.kept = Some(match kept {
            Some(kept) => kept.with(cell.kind, cell.label_ah),
            None => Kept::new(cell.kind, cell.label_ah),
        });
    }

    fn update(&mut self, sample: &Sample) -> Report {
        if !sample.healthy {
            return Report::default();
        }
        let voltage_v = f64::from(sample.voltage_v) / self.cells();
        if self.cycle.is_none() && sample.current_a.is_none() {
            return self.by_voltage_alone(sample);
        }
        let current_a = f64::from(sample.current_a.unwrap_or(0.0));
        match &mut self.cycle {
            None => {
                let kept = self.kept.as_ref().expect("power is on");
                self.cycle = Some(PowerCycle::new(self.cell(), kept, voltage_v, current_a));
            }
            Some(cycle) => cycle.update(sample.t_s - self.before_s, voltage_v, current_a),
        }
        self.before_s = sample.t_s;
        let Some(estimate) = self.cycle.as_ref().and_then(PowerCycle::estimate) else {
            return Report::default();
        };
        let percent = |share: f64| Some((100.0 * share) as f32);
        Report {
            remaining_pct: percent(estimate.charge),
            sigma_pct: percent(estimate.sigma),
            usable_pct: percent(estimate.usable),
            usable_sigma_pct: percent(estimate.usable_sigma),
            time_left_s: estimate.time_left_s.map(|time_s| time_s as f32),
            has_fault: self.cycle.as_ref().is_some_and(|cycle| !cycle.is_plausible()),
        }
    }

    fn set_remaining(&mut self, remaining_pct: f32) {
        if let Some(cycle) = &mut self.cycle {
            cycle.set_charge(f64::from(remaining_pct) / 100.0, 0.02);
        }
    }

    fn capacity_ah(&self) -> Option<f64> {
        self.kept()?.capacity_ah()
    }
}

/// Of each chemistry: twelve random drives of a pack, some of which begin under load, with a label up to a third off.
fn random_drives() -> Vec<(PackSettings, Vec<Vec<Sample>>)> {
    let drives_of = |(seed, chemical): (u64, Chemical)| {
        let mut random = Rng::with_seed(seed);
        let mut pack = Pack::any(chemical, &mut random);
        let label_ah = pack.capacity_ah * (0.7 + 0.6 * random.f64());
        let drives = (0..12).map(|_| random_drive(&mut pack, &mut random));
        let drives = drives.collect();
        (chemical.cell.settings(label_ah), drives)
    };
    (0..).zip(CHEMICALS).map(drives_of).collect()
}

/// Loads of random size and duration at a sample a second, with rests, gaps and charging, down to empty.
fn random_drive(pack: &mut Pack, random: &mut Rng) -> Vec<Sample> {
    if random.bool() {
        pack.charge_to(1.0);
    } else {
        pack.charge = 0.3 + 0.7 * random.f64();
    }
    let mut samples = Vec::new();
    let mut t_s = 0.0;
    while pack.charge > 0.0 && t_s < 4000.0 {
        let load_per_h = [0.0, 0.0, -0.3, 0.3, 1.0, 2.0, 3.0][random.usize(0..7)];
        let current_a = load_per_h * pack.capacity_ah * random.f64();
        for _ in 0..random.usize(1..200) {
            pack.draw(current_a, 1.0);
            let voltage_v = pack.voltage_v(current_a) + 0.002 * deviation(random);
            samples.push(Sample::measured(t_s, voltage_v, current_a, true));
            t_s += 1.0;
        }
        t_s += if random.f64() < 0.1 { 300.0 } else { 0.0 };
    }
    samples
}

/// Whatever is driven, each hypothesis stays a Gaussian: no state becomes a combination of others.
#[test]
fn correlations_stay_far_from_singular() {
    for (settings, drives) in random_drives() {
        let mut challenger = Challenger::default();
        for (number, drive) in drives.iter().enumerate() {
            challenger.start(&settings);
            for sample in drive {
                challenger.update(sample);
                let cycle = challenger.cycle.as_ref().expect("a drive");
                let is_due = sample.t_s % 10.0 == 0.0;
                let covariances = cycle.hypotheses.0.iter().map(|one| &one.gaussian.covariance);
                assert!(
                    !is_due || covariances.clone().all(|covariance| covariance.is_above(0.001)),
                    "{:?}, drive {number}, {} s",
                    settings.chemistry,
                    sample.t_s
                );
            }
        }
    }
}

/// Equal readings give equal estimates, also of a copy that was made between two drives.
#[test]
fn equal_readings_give_equal_estimates() {
    let bits = |report: Report| {
        [report.remaining_pct, report.sigma_pct, report.usable_pct].map(|pct| pct.map(f32::to_bits))
    };
    for (settings, drives) in random_drives() {
        let mut challenger = Challenger::default();
        for drive in &drives {
            let mut copy = challenger.clone();
            challenger.start(&settings);
            copy.start(&settings);
            for sample in drive {
                assert_eq!(bits(challenger.update(sample)), bits(copy.update(sample)));
            }
        }
    }
}
