//! Judges estimators of a pack's charge by all drives at once: measured ones, which are not part of the repository, and simulated
//! ones. It prints the table of goals:
//!
//! `BATTERY_RECORDINGS=folder cargo test -p battery-gauge --profile harness --test harness -- --ignored --nocapture`
//!
//! Without the folder only the simulated ones are judged. `ACCEPT=1` writes the documentation's table and picture, and
//! `BATTERY_CHALLENGER=1` judges the challenger, too.

mod accuracy;
mod challenger;
#[allow(dead_code, reason = "the challenger uses curves")]
#[path = "../../src/chemistry.rs"]
mod chemistry;
mod drive;
mod estimator;
mod goals;
mod owner;
mod page;
mod recordings;
mod results;
mod runs;
#[path = "../battery_traces/sample.rs"]
mod sample;
mod score;
mod simulated;
mod table;

use std::env;

use battery_gauge::PackSettings;

use challenger::Challenger;
use drive::Drive;
use estimator::{Estimator, Monitor, Report};
use results::{Results, lives};
use runs::{Start, outcome};
use sample::Sample;

#[test]
#[ignore = "takes a minute, optimised"]
fn goals_of_all_drives() {
    let mut drives = recordings::drives();
    if drives.is_empty() {
        println!("Nothing was judged of recordings: BATTERY_RECORDINGS names no folder.");
    }
    drives.extend(simulated::drives());
    let lives = lives(&drives);
    let results = Results::of::<Monitor>(&drives, &lives);
    let mut columns = vec![(Monitor::NAME, goals::rows(&results))];
    // It takes as long again.
    if std::env::var_os("BATTERY_CHALLENGER").is_some() {
        let results = Results::of::<Challenger>(&drives, &lives);
        columns.push((Challenger::NAME, goals::rows(&results)));
    }
    table::print(&columns);
    table::print_comparison(&columns);
    goals::print_weeks(Monitor::NAME, &results);
    if env::var_os("ACCEPT").is_some() {
        let pictured = drives
            .iter()
            .find(|drive| drive.group == "LiPo" && drive.number == 0);
        page::write(&columns[0].1, pictured.expect("simulated"));
    }
    assert!(
        results.faulty.iter().all(|faulty| faulty.is_finite),
        "something is not a number"
    );
}

/// Counts from full by the label, as ArduPilot does.
#[derive(Clone, Default)]
struct Counting {
    label_ah: f64,
    drawn_ah: f64,
    before_s: Option<f64>,
}

impl Estimator for Counting {
    const NAME: &'static str = "counting";

    fn start(&mut self, settings: &PackSettings) {
        *self = Self {
            label_ah: f64::from(settings.capacity_mah.expect("a label")) / 1000.0,
            ..Self::default()
        };
    }

    fn update(&mut self, sample: &Sample) -> Report {
        let hours = (sample.t_s - self.before_s.replace(sample.t_s).unwrap_or(sample.t_s)) / 3600.0;
        self.drawn_ah += f64::from(sample.current_a.unwrap_or(0.0)) * hours;
        let remaining_pct = 100.0 * (1.0 - self.drawn_ah / self.label_ah);
        Report {
            remaining_pct: Some(remaining_pct as f32),
            sigma_pct: Some(2.0),
            ..Report::default()
        }
    }

    fn set_remaining(&mut self, remaining_pct: f32) {
        self.drawn_ah = self.label_ah * (1.0 - f64::from(remaining_pct) / 100.0);
    }

    fn capacity_ah(&self) -> Option<f64> {
        None
    }
}

/// A second estimator stands beside the first, and its errors are those that its label explains.
#[test]
fn an_estimator_that_counts_is_judged_as_counting() {
    let drives: Vec<Drive> = simulated::drives()
        .into_iter()
        .filter(|drive| drive.number == 0)
        .collect();
    for drive in &drives {
        let off = drive.right_label_ah() / drive.capacity_ah - 1.0;
        for (start, most) in [
            (Start::Full, off.abs()),
            (Start::LabelLow, 0.25),
            (Start::LabelHigh, 0.17),
        ] {
            let score = outcome::<Counting>(drive, start).score;
            let worst = score
                .remaining
                .errors_pct
                .iter()
                .fold(0.0_f64, |worst, error| worst.max(error.abs()));
            assert!(
                (worst - 100.0 * most).abs() < 3.0,
                "{} {start:?}: {worst:.1}",
                drive.group
            );
            let is_inside = score.remaining.inside_two() == 1.0;
            assert_eq!(is_inside, worst <= 4.5, "{} {start:?}: {worst:.1}", drive.group);
        }
    }
}
