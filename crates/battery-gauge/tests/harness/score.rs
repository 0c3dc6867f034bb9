//! Figures of one drive.

use crate::drive::Drive;
use crate::estimator::{Estimator, Report};
use crate::sample::{Sample, root_mean_square};
use battery_gauge::PackSettings;

/// Errors count from here on, in seconds.
const SCORED_FROM_S: f64 = 60.0;

/// A truth within two stated deviations is this much off at most, in points, as reports are rounded.
const ROUNDED_PCT: f64 = 0.5;

/// The usable charge that warns, in percent.
const LOW_PCT: f32 = 15.0;

/// A pack is known up to this deviation, in percent.
const KNOWN_SIGMA_PCT: f32 = 25.0;

/// Power comes on, and all samples are read.
pub fn run<E: Estimator>(estimator: &mut E, settings: &PackSettings, samples: &[Sample]) -> Vec<Report> {
    estimator.start(settings);
    samples.iter().map(|sample| estimator.update(sample)).collect()
}

/// Errors of a state of charge over a time.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    pub errors_pct: Vec<f64>,
    /// Stated deviations, in percent.
    sigmas_pct: Vec<f64>,
    /// Samples, known or not.
    samples: usize,
    known: usize,
}

impl Errors {
    /// Adds a report; a truth that is not known does not count.
    pub fn add(&mut self, report: &Report, truth_pct: f64) {
        if truth_pct.is_nan() {
            return;
        }
        self.samples += 1;
        let Some((remaining_pct, sigma_pct)) = report.remaining_pct.zip(report.sigma_pct) else {
            return;
        };
        self.known += usize::from(sigma_pct <= KNOWN_SIGMA_PCT);
        self.errors_pct.push(f64::from(remaining_pct) - truth_pct);
        self.sigmas_pct.push(f64::from(sigma_pct));
    }

    pub fn append(&mut self, other: &Self) {
        self.errors_pct.extend_from_slice(&other.errors_pct);
        self.sigmas_pct.extend_from_slice(&other.sigmas_pct);
        self.samples += other.samples;
        self.known += other.known;
    }

    /// RMS error, in points.
    pub fn rms(&self) -> f64 {
        root_mean_square(&self.errors_pct)
    }

    /// Share of the known time with the truth inside two stated deviations and a margin.
    pub fn inside(&self, margin_pct: f64) -> f64 {
        let pairs = self.errors_pct.iter().zip(&self.sigmas_pct);
        let inside = pairs
            .filter(|(error, sigma)| error.abs() <= 2.0 * **sigma + margin_pct)
            .count();
        inside as f64 / self.errors_pct.len() as f64
    }

    /// The same, with the margin for rounding.
    pub fn inside_two(&self) -> f64 {
        self.inside(ROUNDED_PCT)
    }

    /// Mean stated deviation, in points.
    pub fn sigma(&self) -> f64 {
        mean(&self.sigmas_pct)
    }

    /// Share of the time with an estimate that is certain enough.
    pub fn known(&self) -> f64 {
        self.known as f64 / self.samples as f64
    }
}

pub fn mean(numbers: &[f64]) -> f64 {
    numbers.iter().sum::<f64>() / numbers.len() as f64
}

/// Figures of a drive that was run from some sample on.
#[derive(Clone, Debug)]
pub struct Score {
    pub remaining: Errors,
    /// RMS error of the usable charge until the cell is empty, in points.
    pub usable_rms: f64,
    /// Mean error over the last fifth, in points.
    pub last_fifth: f64,
    /// Usable and remaining charge that are reported when the cell is empty, in percent.
    pub usable_at_end: f64,
    pub remaining_at_end: f64,
    /// How long before the end 15 % are reported, in minutes; infinite if never.
    pub low_ahead_min: f64,
    /// Time left that is reported half an hour and ten minutes before, in minutes; NaN if none is.
    pub half_hour_min: f64,
    pub ten_minutes_min: f64,
    /// Whether each number is one.
    pub is_finite: bool,
    pub has_fault: bool,
}

impl Score {
    /// Of reports from the sample `start` on.
    pub fn of(drive: &Drive, start: usize, reports: &[Report]) -> Self {
        let start_s = drive.seconds(start);
        let end_s = drive.seconds(drive.empty);
        let mut remaining = Errors::default();
        let (mut usable_errors, mut last_errors) = (Vec::new(), Vec::new());
        let mut next_s = start_s + SCORED_FROM_S;
        let mut score = Self {
            remaining: Errors::default(),
            usable_rms: f64::NAN,
            last_fifth: f64::NAN,
            usable_at_end: f64::NAN,
            remaining_at_end: f64::NAN,
            low_ahead_min: f64::NEG_INFINITY,
            half_hour_min: f64::NAN,
            ten_minutes_min: f64::NAN,
            is_finite: true,
            has_fault: false,
        };
        for (at, report) in (start..).zip(reports) {
            let here_s = drive.seconds(at);
            let numbers = [
                report.remaining_pct,
                report.sigma_pct,
                report.usable_pct,
                report.time_left_s,
            ];
            score.is_finite &= numbers.iter().flatten().all(|number| number.is_finite());
            score.has_fault |= report.has_fault;
            if at <= drive.empty {
                score.usable_at_end = report.usable_pct.map_or(f64::NAN, f64::from);
                score.remaining_at_end = report.remaining_pct.map_or(f64::NAN, f64::from);
                let left_min = report
                    .time_left_s
                    .map_or(f64::NAN, |left_s| f64::from(left_s) / 60.0);
                if here_s <= end_s - 1800.0 {
                    score.half_hour_min = left_min;
                }
                if here_s <= end_s - 600.0 {
                    score.ten_minutes_min = left_min;
                }
            }
            // Once a second: drives weigh by their durations, not by their rates.
            if here_s < next_s {
                continue;
            }
            next_s = here_s + 0.95;
            if at <= drive.last_load.max(drive.empty) {
                remaining.add(report, drive.truth_pct[at]);
            }
            if at > drive.empty {
                continue;
            }
            if let Some(usable_pct) = report.usable_pct {
                let error_pct = f64::from(usable_pct) - drive.usable_pct(at);
                usable_errors.push(error_pct);
                if drive.usable_pct(at) <= 20.0 {
                    last_errors.push(error_pct.abs());
                }
                if usable_pct <= LOW_PCT && score.low_ahead_min.is_infinite() {
                    score.low_ahead_min = (end_s - here_s) / 60.0;
                }
            }
        }
        Self {
            remaining,
            usable_rms: root_mean_square(&usable_errors),
            last_fifth: mean(&last_errors),
            ..score
        }
    }

    /// Of one that only counts from full by this capacity, as ArduPilot does.
    pub fn of_counting(drive: &Drive, capacity_ah: f64) -> f64 {
        let scored = |at: &usize| drive.seconds(*at) >= SCORED_FROM_S && !drive.truth_pct[*at].is_nan();
        let error = |at: usize| 100.0 * (1.0 - drive.drawn_ah[at] / capacity_ah) - drive.truth_pct[at];
        let errors: Vec<f64> = (0..=drive.last_load.max(drive.empty))
            .filter(scored)
            .map(error)
            .collect();
        root_mean_square(&errors)
    }
}

/// By how much two runs differ of what is told, by the first one's deviations.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    /// In points, RMS.
    pub rms: f64,
    /// Relative to the mean stated deviation.
    pub in_deviations: f64,
}

impl Moved {
    pub fn between(plain: &[Report], varied: &[Report]) -> Self {
        let (mut moves, mut sigmas) = (Vec::new(), Vec::new());
        for (plain, varied) in plain.iter().zip(varied) {
            if let (Some(here), Some(there), Some(sigma_pct)) =
                (plain.remaining_pct, varied.remaining_pct, plain.sigma_pct)
            {
                moves.push(f64::from(there - here));
                sigmas.push(f64::from(sigma_pct));
            }
        }
        let rms = root_mean_square(&moves);
        Self {
            rms,
            in_deviations: rms / mean(&sigmas),
        }
    }

    /// Whether nobody would notice.
    pub fn is_small(&self) -> bool {
        self.rms <= 1.0 || self.in_deviations <= 0.25
    }
}
