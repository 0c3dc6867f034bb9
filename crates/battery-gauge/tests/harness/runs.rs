//! Runs of each drive: from full, from half, by voltage alone, repeated, with a wrong label.

use std::sync::Mutex;
use std::thread;

use battery_gauge::{Chemistry, PackSettings};
use fastrand::Rng;

use crate::drive::Drive;
use crate::estimator::{Estimator, Report};
use crate::sample::{Sample, without_current};
use crate::score::{Moved, Score, run};
use crate::simulated::deviation;

/// Noise of the voltage that must not matter, in volts.
const NOISE_V: f64 = 0.001;

/// Kinds of start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Start {
    /// Full, with the right label.
    Full,
    /// Full, after this drive was learnt from.
    Again,
    /// Found with half of its charge, under load.
    Half,
    /// Full, without a current sensor.
    VoltageOnly,
    /// The second full drive of a pack whose label is a fifth too low.
    LabelLow,
    /// Too high.
    LabelHigh,
}

pub const STARTS: [Start; 6] = [
    Start::Full,
    Start::Again,
    Start::Half,
    Start::VoltageOnly,
    Start::LabelLow,
    Start::LabelHigh,
];

/// A run with its figures.
#[derive(Clone, Debug)]
pub struct Outcome<'a> {
    pub drive: &'a Drive,
    pub start: Start,
    pub score: Score,
    /// With noise on the voltage, and without the first second if it begins at rest.
    pub moved: Vec<(&'static str, Moved)>,
}

pub const VARIATIONS: [&str; 2] = ["1 mV of noise", "without its first second"];

/// The samples with noise on the voltage.
pub fn with_noise(samples: &[Sample], seed: u64) -> Vec<Sample> {
    let mut random = Rng::with_seed(seed);
    let noisy = |sample: &Sample| Sample {
        voltage_v: sample.voltage_v + (NOISE_V * deviation(&mut random)) as f32,
        ..*sample
    };
    samples.iter().map(noisy).collect()
}

/// Works on all items with all processors; results are in the same order.
pub fn in_parallel<'a, T: Sync, R: Send>(items: &'a [T], work: impl Fn(&'a T) -> R + Sync) -> Vec<R> {
    let next = Mutex::new(0..items.len());
    let results = Mutex::new(Vec::new());
    let workers = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let Some(number) = next.lock().expect("no panic").next() else {
                        return;
                    };
                    let result = work(&items[number]);
                    results.lock().expect("no panic").push((number, result));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no panic");
    results.sort_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Every kind of start of every drive.
pub fn outcomes<E: Estimator>(drives: &[Drive]) -> Vec<Outcome<'_>> {
    let jobs: Vec<(&Drive, Start)> = drives
        .iter()
        .flat_map(|drive| STARTS.map(|start| (drive, start)))
        .collect();
    in_parallel(&jobs, |(drive, start)| outcome::<E>(drive, *start))
}

pub fn outcome<E: Estimator>(drive: &Drive, start: Start) -> Outcome<'_> {
    let settings = drive.cell.settings(match start {
        Start::LabelLow => 0.8 * drive.capacity_ah,
        Start::LabelHigh => 1.2 * drive.capacity_ah,
        _ => drive.right_label_ah(),
    });
    let mut estimator = E::default();
    if matches!(start, Start::Again | Start::LabelLow | Start::LabelHigh) {
        run(&mut estimator, &settings, &drive.samples);
    }
    let first = if start == Start::Half { drive.middle() } else { 0 };
    let mut samples = drive.samples[first..].to_vec();
    if start == Start::VoltageOnly {
        samples = without_current(&samples);
    }
    let reports = run(&mut estimator.clone(), &settings, &samples);
    let mut moved = Vec::new();
    let noisy = run(&mut estimator.clone(), &settings, &with_noise(&samples, 1));
    moved.push((VARIATIONS[0], Moved::between(&reports, &noisy)));
    if first == 0 && drive.begins_at_rest() {
        let second = drive.after_first_second();
        let shorter = run(&mut estimator.clone(), &settings, &samples[second..]);
        moved.push((VARIATIONS[1], Moved::between(&reports[second..], &shorter)));
    }
    Outcome {
        drive,
        start,
        score: Score::of(drive, first, &reports),
        moved,
    }
}

/// Capacities relative to the true one after ten, twenty and thirty equal drives; the label's where nothing is learnt.
#[derive(Clone, Debug)]
pub struct Repeated<'a> {
    pub drive: &'a Drive,
    pub capacities: [f64; 3],
    pub has_learnt: bool,
}

pub fn repeated<E: Estimator>(drives: &[Drive]) -> Vec<Repeated<'_>> {
    let drives: Vec<&Drive> = drives.iter().filter(|drive| !drive.cell.is_life).collect();
    in_parallel(&drives, |drive| {
        let settings = drive.cell.settings(drive.capacity_ah);
        let mut estimator = E::default();
        let capacities = std::array::from_fn(|_| {
            for _ in 0..10 {
                estimator.start(&settings);
                for sample in &drive.samples {
                    estimator.update(sample);
                }
            }
            estimator.capacity_ah().unwrap_or(drive.capacity_ah) / drive.capacity_ah
        });
        Repeated {
            drive,
            capacities,
            has_learnt: estimator.capacity_ah().is_some(),
        }
    })
}

/// RMS errors from full of each group of drives, after a drive that has drawn half of the charge.
#[derive(Clone, Debug)]
pub struct Teacher {
    pub name: String,
    pub rms: f64,
    pub has_taught: bool,
}

/// Each of these drives teaches, and all of them are driven then.
pub fn teachers<E: Estimator>(drives: &[&Drive]) -> Vec<Teacher> {
    let long = |drive: &&&Drive| drive.drawn_ah[drive.last_load] >= 0.5 * drive.capacity_ah;
    let teachers: Vec<&&Drive> = drives.iter().filter(long).collect();
    in_parallel(&teachers, |teacher| {
        let mut taught = E::default();
        run(
            &mut taught,
            &teacher.cell.settings(teacher.right_label_ah()),
            &teacher.samples,
        );
        let rms = |drive: &&Drive| {
            let settings = drive.cell.settings(drive.right_label_ah());
            let reports = run(&mut taught.clone(), &settings, &drive.samples);
            (drive.group.clone(), Score::of(drive, 0, &reports).remaining.rms())
        };
        let groups = by_group(drives.iter().map(rms));
        Teacher {
            name: teacher.group.clone(),
            rms: groups.iter().map(|(_, rms)| rms).sum::<f64>() / groups.len() as f64,
            has_taught: taught.capacity_ah().is_some(),
        }
    })
}

/// Means of groups, in the order of their first members, without those that are not a number.
pub fn by_group(figures: impl Iterator<Item = (String, f64)>) -> Vec<(String, f64)> {
    let mut groups: Vec<(String, Vec<f64>)> = Vec::new();
    for (group, figure) in figures {
        let number = groups
            .iter()
            .position(|(name, _)| *name == group)
            .unwrap_or(groups.len());
        if number == groups.len() {
            groups.push((group, Vec::new()));
        }
        if !figure.is_nan() {
            groups[number].1.push(figure);
        }
    }
    let mean =
        |(group, figures): (String, Vec<f64>)| (group, figures.iter().sum::<f64>() / figures.len() as f64);
    groups.into_iter().map(mean).collect()
}

/// A cell's drives in their order.
#[derive(Clone, Debug)]
pub struct Life {
    pub name: String,
    pub scores: Vec<Score>,
    /// By each variation.
    pub moved: [Moved; VARIATIONS.len()],
}

/// One pack through all these drives.
pub fn life<E: Estimator>(name: &str, drives: &[Drive]) -> Life {
    let cell = &drives[0].cell;
    let settings = cell.settings(cell.label_ah.unwrap_or(drives[0].capacity_ah));
    let [mut estimator, mut noisy, mut late] = [E::default(), E::default(), E::default()];
    let [mut all, mut all_but_seconds, mut all_noisy, mut all_late]: [Vec<Report>; 4] = Default::default();
    let mut scores = Vec::new();
    for (number, drive) in drives.iter().enumerate() {
        let samples = &drive.samples;
        let second = if drive.begins_at_rest() {
            drive.after_first_second()
        } else {
            0
        };
        let reports = run(&mut estimator, &settings, samples);
        scores.push(Score::of(drive, 0, &reports));
        all_but_seconds.extend_from_slice(&reports[second..]);
        all.extend(reports);
        all_noisy.extend(run(&mut noisy, &settings, &with_noise(samples, number as u64)));
        all_late.extend(run(&mut late, &settings, &samples[second..]));
    }
    Life {
        name: name.into(),
        scores,
        moved: [
            Moved::between(&all, &all_noisy),
            Moved::between(&all_but_seconds, &all_late),
        ],
    }
}

/// A fault of the sensor or the settings during one drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    Reversed,
    OffsetAndGain,
    VoltageScale,
    Saturated,
    Gaps,
    WrongCells,
    WrongChemistry,
    LabelLow,
    LabelHigh,
}

pub const FAULTS: [(Fault, &str); 9] = [
    (Fault::Reversed, "current reversed"),
    (Fault::OffsetAndGain, "offset 0.15 A, gain 5 % wrong"),
    (Fault::VoltageScale, "voltage scale 3 % off"),
    (Fault::Saturated, "sensor saturates"),
    (Fault::Gaps, "gaps of seconds to hours"),
    (Fault::WrongCells, "wrong cells"),
    (Fault::WrongChemistry, "wrong chemistry"),
    (Fault::LabelLow, "label 30 % low"),
    (Fault::LabelHigh, "label 30 % high"),
];

impl Fault {
    fn samples(self, drive: &Drive) -> Vec<Sample> {
        let largest_a =
            1.5 * (drive.drawn_ah[drive.last_load] / drive.seconds(drive.last_load) * 3600.0) as f32;
        let mut samples = drive.samples.clone();
        for sample in &mut samples {
            let current_a = sample.current_a.expect("a current");
            match self {
                Self::Reversed => sample.current_a = Some(-current_a),
                Self::OffsetAndGain => sample.current_a = Some(0.15 + 1.05 * current_a),
                Self::VoltageScale => sample.voltage_v *= 1.03,
                Self::Saturated => sample.current_a = Some(current_a.min(largest_a)),
                Self::Gaps | Self::WrongCells | Self::WrongChemistry | Self::LabelLow | Self::LabelHigh => {}
            }
        }
        if self == Self::Gaps {
            return with_gaps(drive, samples);
        }
        samples
    }

    fn settings(self, drive: &Drive) -> PackSettings {
        let right = drive.cell.settings(drive.right_label_ah());
        match self {
            Self::WrongCells => PackSettings {
                cell_count: Some(2),
                ..right
            },
            Self::WrongChemistry => PackSettings {
                chemistry: match right.chemistry {
                    Chemistry::LiIon => Chemistry::LiPo,
                    _ => Chemistry::LiIon,
                },
                ..right
            },
            Self::LabelLow => drive.cell.settings(0.7 * drive.capacity_ah),
            Self::LabelHigh => drive.cell.settings(1.3 * drive.capacity_ah),
            _ => right,
        }
    }
}

/// Readings are lost for five seconds, half a minute and five minutes; behind the drive the pack is left for three hours.
fn with_gaps(drive: &Drive, mut samples: Vec<Sample>) -> Vec<Sample> {
    let (start_s, duration_s) = (samples[0].t_s, drive.seconds(drive.last_load));
    let gaps = [(0.2, 5.0), (0.4, 30.0), (0.6, 300.0)];
    for sample in &mut samples[drive.last_load + 1..] {
        sample.t_s += 3.0 * 3600.0;
    }
    samples.retain(|sample| {
        let here_s = sample.t_s - start_s;
        !gaps
            .iter()
            .any(|(share, gap_s)| (share * duration_s..share * duration_s + gap_s).contains(&here_s))
    });
    samples
}

/// Bad input in one drive, then three sound ones.
#[derive(Clone, Debug)]
pub struct Faulty<'a> {
    pub drive: &'a Drive,
    pub fault: Fault,
    /// In that drive or the one after it.
    pub is_announced: bool,
    pub is_finite: bool,
    /// The drives after it.
    pub after: Vec<Score>,
}

pub fn faulty<'a, E: Estimator>(drives: &[&'a Drive]) -> Vec<Faulty<'a>> {
    let jobs: Vec<(&'a Drive, Fault)> = drives
        .iter()
        .flat_map(|drive| FAULTS.map(|(fault, _)| (*drive, fault)))
        .collect();
    in_parallel(&jobs, |(drive, fault)| {
        let mut estimator = E::default();
        let reports = run(&mut estimator, &fault.settings(drive), &fault.samples(drive));
        let settings = drive.cell.settings(drive.right_label_ah());
        let after = (0..3).map(|_| Score::of(drive, 0, &run(&mut estimator, &settings, &drive.samples)));
        let after: Vec<Score> = after.collect();
        Faulty {
            drive,
            fault: *fault,
            is_announced: after[0].has_fault || reports.iter().any(|report| report.has_fault),
            is_finite: after.iter().all(|score| score.is_finite) && reports.iter().all(Report::is_finite),
            after,
        }
    })
}
