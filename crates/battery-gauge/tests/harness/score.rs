//! Figures of one drive.

use std::collections::VecDeque;

use battery_gauge::PackSettings;

use crate::drive::Drive;
use crate::estimator::{Estimator, Report};
use crate::sample::{Sample, root_mean_square};

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
    /// Adds an estimate with its deviation; a truth that is not known does not count.
    fn add(&mut self, estimate: Option<(f32, f32)>, truth_pct: f64) {
        if truth_pct.is_nan() {
            return;
        }
        self.samples += 1;
        let Some((estimate_pct, sigma_pct)) = estimate else {
            return;
        };
        self.known += usize::from(sigma_pct <= KNOWN_SIGMA_PCT);
        self.errors_pct.push(f64::from(estimate_pct) - truth_pct);
        self.sigmas_pct.push(f64::from(sigma_pct));
    }

    /// Adds the state of charge of a report.
    pub fn add_remaining(&mut self, report: &Report, truth_pct: f64) {
        self.add(report.remaining_pct.zip(report.sigma_pct), truth_pct);
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

    /// Share of errors inside two deviations, with a margin for rounding.
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
    /// While the load lasts.
    pub remaining: Errors,
    /// Until the end of the recording.
    pub with_rest: Errors,
    /// Of the usable charge until the cell is empty.
    pub usable: Errors,
    /// Mean error over the last fifth, in points.
    pub last_fifth: f64,
    /// Usable and remaining charge that are reported when the cell is empty, in percent.
    pub usable_at_end: f64,
    pub remaining_at_end: f64,
    /// The most that it rises within ten minutes until the end, less what is charged, in points.
    pub usable_rise: f64,
    /// Usable charge that is reported ten seconds after the end, and the most from then on, in percent.
    pub usable_after_end: f64,
    pub usable_comes_back: f64,
    /// True usable charge when 0 is reported first, in percent; NaN if it never is.
    pub usable_at_zero: f64,
    /// How long before the end 15 % are reported, in minutes; minus infinity if never.
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
        let end = drive.empty.saturating_sub(start).min(reports.len() - 1);
        let at_end = &reports[end];
        let before_end = |minutes: f64| {
            let t_s = drive.samples[drive.empty].t_s - 60.0 * minutes;
            let next = drive.samples[start..].partition_point(|sample| sample.t_s <= t_s);
            let report = next.checked_sub(1).map(|at| &reports[at]);
            or_nan(report.and_then(|report| report.time_left_s)) / 60.0
        };
        let after_s = drive.samples[drive.empty].t_s + 10.0;
        let after = drive.samples[start..]
            .partition_point(|sample| sample.t_s < after_s)
            .min(reports.len() - 1);
        let later = reports[after..].iter().map(|report| or_nan(report.usable_pct));
        let is_zero = |report: &Report| report.usable_pct.is_some_and(|usable_pct| usable_pct < 0.5);
        let zero = reports[..=end].iter().position(is_zero);
        let is_low = |report: &Report| report.usable_pct.is_some_and(|usable_pct| usable_pct <= LOW_PCT);
        let low = reports[..=end].iter().position(is_low);
        let low_ahead_s = low.map(|at| drive.seconds(drive.empty) - drive.seconds(start + at));
        let mut score = Self {
            remaining: Errors::default(),
            with_rest: Errors::default(),
            usable: Errors::default(),
            last_fifth: f64::NAN,
            usable_at_end: or_nan(at_end.usable_pct),
            remaining_at_end: or_nan(at_end.remaining_pct),
            usable_rise: largest_rise(drive, start, &reports[..=end]),
            usable_after_end: or_nan(reports[after].usable_pct),
            usable_comes_back: later.fold(f64::NAN, f64::max),
            usable_at_zero: zero.map_or(f64::NAN, |at| drive.usable_pct(start + at)),
            low_ahead_min: low_ahead_s.map_or(f64::NEG_INFINITY, |ahead_s| ahead_s / 60.0),
            half_hour_min: before_end(30.0),
            ten_minutes_min: before_end(10.0),
            is_finite: reports.iter().all(Report::is_finite),
            has_fault: reports.iter().any(|report| report.has_fault),
        };
        score.compare(drive, start, reports);
        score
    }

    /// Compares with the truth once a second: drives weigh by their durations, not by their rates.
    fn compare(&mut self, drive: &Drive, start: usize, reports: &[Report]) {
        let mut next_s = drive.seconds(start) + SCORED_FROM_S;
        let mut last_errors = Vec::new();
        for (at, report) in (start..).zip(reports) {
            if drive.seconds(at) < next_s {
                continue;
            }
            next_s = drive.seconds(at) + 0.95;
            self.with_rest.add_remaining(report, drive.truth_pct[at]);
            if at <= drive.end() {
                self.remaining.add_remaining(report, drive.truth_pct[at]);
            }
            if at <= drive.empty {
                let truth_pct = drive.usable_pct(at);
                self.usable
                    .add(report.usable_pct.zip(report.usable_sigma_pct), truth_pct);
                if let Some(usable_pct) = report.usable_pct.filter(|_| truth_pct <= 20.0) {
                    last_errors.push((f64::from(usable_pct) - truth_pct).abs());
                }
            }
        }
        self.last_fifth = mean(&last_errors);
    }

    /// RMS error until a sample of one that only counts from full by this capacity, as ArduPilot does.
    pub fn of_counting(drive: &Drive, capacity_ah: f64, until: usize) -> f64 {
        let scored = |at: &usize| drive.seconds(*at) >= SCORED_FROM_S && !drive.truth_pct[*at].is_nan();
        let error = |at: usize| 100.0 * (1.0 - drive.drawn_ah[at] / capacity_ah) - drive.truth_pct[at];
        let errors: Vec<f64> = (0..=until).filter(scored).map(error).collect();
        root_mean_square(&errors)
    }
}

/// The most that the usable charge rises within ten minutes, less what is charged, in points; NaN if it is never known.
fn largest_rise(drive: &Drive, start: usize, reports: &[Report]) -> f64 {
    const WITHIN_S: f64 = 600.0;
    let mut largest = f64::NAN;
    let (mut charged_ah, mut before_ah) = (0.0, drive.drawn_ah[start]);
    // Candidates for the lowest value of the last ten minutes: times and values, both rising.
    let mut lowest: VecDeque<(f64, f64)> = VecDeque::new();
    for (at, report) in (start..).zip(reports) {
        let drawn_ah = drive.drawn_ah[at];
        charged_ah += (before_ah - drawn_ah).max(0.0);
        before_ah = drawn_ah;
        let Some(usable_pct) = report.usable_pct else {
            continue;
        };
        let (here_s, value) = (
            drive.seconds(at),
            f64::from(usable_pct) - 100.0 * charged_ah / drive.capacity_ah,
        );
        while lowest
            .front()
            .is_some_and(|(from_s, _)| here_s - from_s > WITHIN_S)
        {
            lowest.pop_front();
        }
        while lowest.back().is_some_and(|(_, before)| *before >= value) {
            lowest.pop_back();
        }
        lowest.push_back((here_s, value));
        largest = largest.max(value - lowest[0].1);
    }
    largest
}

fn or_nan(number: Option<f32>) -> f64 {
    number.map_or(f64::NAN, f64::from)
}

/// By how much the estimates of two runs differ, by the deviations of the first.
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

    /// Whether no owner would notice.
    pub fn is_small(&self) -> bool {
        self.rms <= 1.0 || self.in_deviations <= 0.25
    }
}
