//! Limits of today's errors on measured drives. Without their folder these tests do nothing. They print what
//! `docs/battery-model.md` lists:
//!
//! `BATTERY_RECORDINGS=folder cargo test -p battery-gauge --test harness -- --nocapture`

use std::collections::BTreeMap;
use std::sync::OnceLock;

use battery_gauge::PackSettings;
use fastrand::Rng;

use crate::drive::Drive;
use crate::estimator::{Estimator, Monitor};
use crate::recordings::{self, LARGE_CELL, WARM_LIFE};
use crate::results::{EVERY_DRIVE, Member, is_first_cell, is_warm, lives};
use crate::runs::life;
use crate::sample::{Sample, without_current};
use crate::score::{Score, mean, run};
use crate::simulated::deviation;

const WRONG_LABELS_AH: [f64; 2] = [2.3, 3.5];

fn recorded() -> &'static [Drive] {
    static DRIVES: OnceLock<Vec<Drive>> = OnceLock::new();
    DRIVES.get_or_init(recordings::drives)
}

/// The drives of the cell that was recorded most.
fn first_cell() -> Vec<&'static Drive> {
    let drives: Vec<&Drive> = recorded().iter().filter(|drive| is_first_cell(drive)).collect();
    if drives.is_empty() {
        println!("skipped: BATTERY_RECORDINGS names no folder");
    }
    drives
}

fn label_ah(drive: &Drive) -> f64 {
    drive.cell.label_ah.expect("a label")
}

/// Figures of a drive from a sample on, with what was learnt before.
fn score(drive: &Drive, start: usize, settings: &PackSettings, learnt: &Monitor) -> Score {
    Score::of(
        drive,
        start,
        &run(&mut learnt.clone(), settings, &drive.samples[start..]),
    )
}

/// RMS error of the remaining charge; infinite if less than nine tenths of the time are known.
fn rms(score: &Score) -> f64 {
    if score.with_rest.known() < 0.9 {
        return f64::INFINITY;
    }
    score.with_rest.rms()
}

/// RMS error of the remaining charge of a new pack with its label.
fn new_rms(drive: &Drive, start: usize) -> f64 {
    rms(&score(
        drive,
        start,
        &drive.cell.settings(label_ah(drive)),
        &Monitor::default(),
    ))
}

/// What is known after each warm drive that teaches, with this label.
fn lessons(label_ah: f64) -> Vec<Monitor> {
    let warm = first_cell().into_iter().filter(|drive| drive.temperature_c >= 25);
    let taught = warm.map(|drive| {
        let mut taught = Monitor::default();
        run(&mut taught, &drive.cell.settings(label_ah), &drive.samples);
        taught
    });
    taught.filter(|taught| taught.capacity_ah().is_some()).collect()
}

/// The mean over what each lesson makes of a drive.
fn mean_of(lessons: &[Monitor], figure: impl Fn(&Monitor) -> f64) -> f64 {
    mean(&lessons.iter().map(figure).collect::<Vec<_>>())
}

/// Asserts that the mean figure at each temperature is within its goal. A single drive may exceed it by a
/// quarter: the goals are those of whole groups.
#[track_caller]
fn assert_means(what: &str, goal: impl Fn(i32) -> f64, figure: impl Fn(&Drive) -> f64) {
    let mut groups: BTreeMap<i32, Vec<f64>> = BTreeMap::new();
    for drive in first_cell() {
        let figure = figure(drive);
        println!("{what:32} {:24} {figure:6.2}", drive.group);
        groups.entry(drive.temperature_c).or_default().push(figure);
    }
    let mut missed = Vec::new();
    for (temperature_c, figures) in groups {
        let (mean, goal) = (mean(&figures), goal(temperature_c));
        println!("{what:32} {temperature_c:4} °C: mean {mean:5.2}, goal {goal:5.2}");
        let limit = if figures.len() == 1 { 1.25 * goal } else { goal };
        if mean.is_nan() || mean > limit {
            missed.push(format!("{temperature_c} °C: {mean:.2} instead of {goal:.2}"));
        }
    }
    assert!(missed.is_empty(), "{what}: {missed:?}");
}

#[test]
fn a_full_pack_is_estimated_as_well_as_by_counting() {
    assert_means(
        "from full, less counting",
        |_| 0.6,
        |drive| {
            let (here, counting) = (
                new_rms(drive, 0),
                Score::of_counting(drive, label_ah(drive), drive.samples.len() - 1),
            );
            println!("{:32} {here:.2}, by counting {counting:.2}", drive.group);
            here - counting
        },
    );
}

#[test]
fn one_warm_drive_teaches_the_pack_and_corrects_a_wrong_label() {
    let Some(drive) = first_cell().first().copied() else {
        return;
    };
    let [less_ah, more_ah] = WRONG_LABELS_AH;
    for (label_ah, goal) in [(label_ah(drive), 1.0), (less_ah, 1.3), (more_ah, 1.3)] {
        let lessons = lessons(label_ah);
        assert!(!lessons.is_empty(), "no drive teaches");
        assert_means(
            &format!("from full, label {label_ah}, learnt"),
            |_| goal,
            |drive| {
                let settings = drive.cell.settings(label_ah);
                mean_of(&lessons, |learnt| rms(&score(drive, 0, &settings, learnt)))
            },
        );
    }
}

#[test]
fn a_pack_found_half_empty_is_estimated_by_its_voltage() {
    let goal = |temperature_c: i32| match temperature_c {
        0.. => 8.0,
        -10.. => 10.0,
        _ => 15.0,
    };
    assert_means("half empty", goal, |drive| new_rms(drive, drive.middle()));
}

#[test]
fn a_learnt_pack_found_half_empty_is_estimated_better() {
    let Some(drive) = first_cell().first().copied() else {
        return;
    };
    let lessons = lessons(label_ah(drive));
    let goal = |temperature_c: i32| match temperature_c {
        0.. => 5.1,
        -10.. => 7.0,
        _ => 11.5,
    };
    let settings = drive.cell.settings(label_ah(drive));
    assert_means("half empty, learnt", goal, |drive| {
        mean_of(&lessons, |learnt| {
            rms(&score(drive, drive.middle(), &settings, learnt))
        })
    });
}

/// A drive as another sensor or another load state would have had it.
fn with_samples(drive: &Drive, samples: Vec<Sample>) -> Drive {
    Drive {
        samples,
        ..drive.clone()
    }
}

#[test]
fn voltage_alone_suffices_for_an_estimate() {
    let goal = |temperature_c: i32| match temperature_c {
        10.. => 5.0,
        0.. => 9.0,
        -10.. => 16.0,
        _ => 25.0,
    };
    for (what, armed) in [("voltage only", true), ("voltage only, disarmed", false)] {
        assert_means(what, goal, |drive| {
            let mut samples = without_current(&drive.samples);
            samples.iter_mut().for_each(|sample| sample.armed = armed);
            new_rms(&with_samples(drive, samples), 0)
        });
    }
}

#[test]
fn the_truth_is_within_two_standard_deviations() {
    let drives = first_cell();
    let Some(drive) = drives.first() else {
        return;
    };
    let settings = drive.cell.settings(label_ah(drive));
    let (new, learnt) = ([Monitor::default()], lessons(label_ah(drive)));
    let shares = |lessons: &[Monitor], start: fn(&Drive) -> usize, drives: &[Drive]| -> Vec<f64> {
        let share = |drive: &Drive| {
            mean_of(lessons, |learnt| {
                100.0
                    * score(drive, start(drive), &settings, learnt)
                        .with_rest
                        .inside(0.0)
            })
        };
        drives.iter().map(share).collect()
    };
    let whole: Vec<Drive> = drives.iter().map(|drive| (*drive).clone()).collect();
    let voltage_only: Vec<Drive> = drives
        .iter()
        .map(|drive| with_samples(drive, without_current(&drive.samples)))
        .collect();
    // Without a current the sag in the cold is unknown.
    for (what, shares, least) in [
        ("from full", shares(&new, |_| 0, &whole), 90.0),
        ("from full, learnt", shares(&learnt, |_| 0, &whole), 90.0),
        ("half empty", shares(&new, Drive::middle, &whole), 90.0),
        ("half empty, learnt", shares(&learnt, Drive::middle, &whole), 90.0),
        ("voltage only", shares(&new, |_| 0, &voltage_only), 85.0),
    ] {
        let mean = mean(&shares);
        println!("{what:32} within two standard deviations {mean:.1} % of the time: {shares:.0?}");
        assert!(mean >= least, "{what}: {mean:.1} %: {shares:.0?}");
    }
}

#[test]
fn usable_charge_warns_minutes_before_a_warm_pack_collapses() {
    let mut leads: BTreeMap<i32, Vec<f64>> = BTreeMap::new();
    for drive in first_cell() {
        let score = score(
            drive,
            0,
            &drive.cell.settings(label_ah(drive)),
            &Monitor::default(),
        );
        println!(
            "{}: warned {:.1} minutes before the end; half an hour before {:.0} minutes were left; usable {:.0} % at \
             the end, {:.1} RMS",
            drive.group,
            score.low_ahead_min,
            score.half_hour_min,
            score.usable_at_end,
            score.usable.rms()
        );
        if is_warm(drive) {
            leads
                .entry(drive.temperature_c)
                .or_default()
                .push(score.low_ahead_min);
        }
    }
    for (temperature_c, mut minutes) in leads {
        minutes.sort_by(f64::total_cmp);
        let median = minutes[minutes.len() / 2];
        println!("{temperature_c} °C: warned {median:.1} minutes before the end in the median");
        let least = if temperature_c >= 25 { 4.0 } else { 2.0 };
        assert!(median >= least, "{temperature_c} °C: {minutes:?}");
    }
}

#[test]
fn a_half_empty_pack_believed_full_is_found_out() {
    let mut missed = Vec::new();
    for drive in first_cell() {
        let half = drive.middle();
        let settled_s = drive.seconds(half) + 360.0;
        let mut estimator = Monitor::default();
        estimator.start(&drive.cell.settings(label_ah(drive)));
        let mut errors_pct = Vec::new();
        for (at, sample) in drive.samples.iter().enumerate() {
            let report = estimator.update(sample);
            if at == half {
                estimator.set_remaining(100.0);
            }
            if drive.seconds(at) >= settled_s {
                let remaining_pct = report.remaining_pct.map_or(f64::INFINITY, f64::from);
                errors_pct.push(remaining_pct - drive.truth_pct[at]);
            }
        }
        let error_pct = *errors_pct.first().expect("a longer drive");
        let largest_pct = errors_pct
            .iter()
            .fold(0.0_f64, |largest, error| largest.max(error.abs()));
        println!(
            "{}: half empty, believed full: {error_pct:.1} % after 6 minutes, then up to {largest_pct:.1} %",
            drive.group
        );
        if is_warm(drive) && error_pct.abs() > 10.0 {
            missed.push(format!("{}: {error_pct:.1} %", drive.group));
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// A worse sensor.
#[derive(Clone, Copy, Debug)]
enum Sensor {
    /// A reading every ten seconds.
    Slow,
    /// 8 mV and 0.1 A of noise, RMS.
    Noisy,
    /// The current arrives 0.3 s late.
    LateCurrent,
    /// Silent for 30 s in every ten minutes.
    ShortGaps,
    /// Silent for two minutes after a third of the drive.
    LongGap,
}

impl Sensor {
    /// The drive as it would have recorded it.
    fn of(self, drive: &Drive) -> Drive {
        let last_s = drive.seconds(drive.samples.len() - 1);
        let mut random = Rng::with_seed(1);
        let mut next_s = 0.0;
        let mut seen = Vec::new();
        for (number, sample) in drive.samples.iter().enumerate() {
            let here_s = drive.seconds(number);
            let is_lost = match self {
                Self::Slow => here_s < next_s,
                Self::ShortGaps => (300.0..330.0).contains(&(here_s % 600.0)),
                Self::LongGap => (last_s / 3.0..last_s / 3.0 + 120.0).contains(&here_s),
                Self::Noisy | Self::LateCurrent => false,
            };
            if is_lost {
                continue;
            }
            next_s = here_s + 9.95;
            let mut sample = *sample;
            match self {
                Self::Noisy => {
                    let mut noise = |sigma: f64| (sigma * deviation(&mut random)) as f32;
                    sample.voltage_v += noise(0.008);
                    sample.current_a = sample.current_a.map(|current_a| current_a + noise(0.1));
                }
                Self::LateCurrent => sample.current_a = drive.samples[number.saturating_sub(3)].current_a,
                Self::Slow | Self::ShortGaps | Self::LongGap => {}
            }
            seen.push((sample, drive.truth_pct[number]));
        }
        let (samples, truth_pct) = seen.into_iter().unzip();
        Drive::new(
            drive.cell,
            drive.group.clone(),
            drive.number,
            drive.temperature_c,
            samples,
            Some(truth_pct),
        )
    }
}

/// Readings every ten seconds miss much of the load of these drives: counting alone is off by as much.
#[test]
fn a_worse_sensor_costs_a_few_percent() {
    for sensor in [
        Sensor::Slow,
        Sensor::Noisy,
        Sensor::LateCurrent,
        Sensor::ShortGaps,
        Sensor::LongGap,
    ] {
        assert_means(
            &format!("{sensor:?}"),
            |_| 5.0,
            |drive| new_rms(&sensor.of(drive), 0),
        );
    }
}

/// Scores of a cell's drives in their order.
fn scores(is_one: impl Fn(&str) -> bool) -> Vec<Score> {
    let lives = lives(recorded());
    let lives = lives.iter().filter(|lived| is_one(&lived.name));
    lives
        .flat_map(|lived| life::<Monitor>(&lived.name, &lived.drives).scores)
        .collect()
}

#[test]
fn an_aged_cell_is_known() {
    let scores = scores(|name| name.starts_with(WARM_LIFE) && name.ends_with(EVERY_DRIVE));
    let half = &scores[scores.len() / 2..];
    if half.is_empty() {
        return;
    }
    let mean_of = |what: &str, figure: fn(&Score) -> f64| -> Member {
        let mean = mean(&half.iter().map(figure).collect::<Vec<_>>());
        println!("second half of life, {what:34} {mean:6.2}");
        (what.to_owned(), mean)
    };
    let at_most = [
        (mean_of("usable charge, RMS", |score| score.usable.rms()), 4.0),
        (
            mean_of("state of charge, RMS", |score| score.remaining.rms()),
            3.2,
        ),
        (mean_of("at cut-off", |score| score.remaining_at_end), 10.5),
        (
            mean_of("time left ten minutes before, min", |score| score.ten_minutes_min),
            13.0,
        ),
    ];
    let at_least = [
        (mean_of("LOW ahead, min", |score| score.low_ahead_min), 4.0),
        (
            mean_of("time left ten minutes before, min", |score| score.ten_minutes_min),
            8.0,
        ),
        (
            mean_of("within two deviations", |score| score.remaining.inside(0.0)),
            0.9,
        ),
        (
            mean_of("usable charge within two", |score| score.usable.inside(0.0)),
            0.9,
        ),
    ];
    for ((what, mean), limit) in at_most {
        assert!(mean <= limit, "{what}: {mean:.2}, at most {limit}");
    }
    for ((what, mean), limit) in at_least {
        assert!(mean >= limit, "{what}: {mean:.2}, at least {limit}");
    }
}

#[test]
fn heavier_drives_do_not_bend_the_curve() {
    let scores = scores(|name| name.starts_with(LARGE_CELL));
    for score in &scores {
        println!("{:.2}, usable {:.2}", score.remaining.rms(), score.usable.rms());
    }
    let worst = scores
        .iter()
        .skip(1)
        .map(|score| score.remaining.rms())
        .fold(0.0, f64::max);
    println!("worst of all but the first {worst:.2}");
    assert!(worst <= 5.3, "{worst}");
}
