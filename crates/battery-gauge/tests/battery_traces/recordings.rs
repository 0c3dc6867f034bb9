//! Errors on measured drives of a real cell, which are not part of the repository.
//!
//! `BATTERY_RECORDINGS` names a folder with `pan18650pf_{group}_{drive}.csv` (`t_s,voltage_v,current_a`) and `.truth.csv`
//! (`t_s,soc`): drives of one Li-ion cell of 2.9 Ah from full to empty, of which `group` begins with the temperature in
//! degrees Celsius, `n` for minus. Without it these tests do nothing. `docs/battery-model.md` lists their figures:
//!
//! `BATTERY_RECORDINGS=folder cargo test -p battery-gauge --test battery_traces recordings:: -- --nocapture`

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use battery_gauge::LearntPack;
use battery_gauge::LoadState;

use super::replay::{Sample, drawn_mah, li_ion_cell, replay, root_mean_square, rows, without_current};

const LABEL_MAH: f32 = 2900.0;
const WRONG_LABELS_MAH: [f32; 2] = [2300.0, 3500.0];

/// Errors count from here on, in seconds.
const SCORED_FROM_S: f64 = 60.0;

/// A current above this is a load, in amperes: a tenth of the capacity an hour.
const LOAD_A: f32 = 0.29;

/// A drive with the true charge at each sample, in percent.
struct Recording {
    name: String,
    group: String,
    samples: Vec<Sample>,
    truth_pct: Vec<f64>,
}

impl Recording {
    /// `pan18650pf_{group}_{drive}`, if it has a truth.
    fn read(folder: &Path, name: &str) -> Option<Self> {
        let (group, _) = name.strip_prefix("pan18650pf_")?.split_once('_')?;
        let text = |ending: &str| fs::read_to_string(folder.join(format!("{name}{ending}"))).ok();
        let truth: Vec<[f64; 2]> = rows(&text(".truth.csv")?).collect();
        let mut samples: Vec<Sample> = rows(&text(".csv")?)
            .map(|[t_s, voltage_v, current_a]: [f64; 3]| Sample::measured(t_s, voltage_v, current_a, true))
            .collect();
        samples.dedup_by(|next, before| next.t_s <= before.t_s);
        let truth_pct = samples
            .iter()
            .map(|sample| 100.0 * at(&truth, sample.t_s))
            .collect();
        Some(Self {
            name: name.into(),
            group: group.into(),
            samples,
            truth_pct,
        })
    }

    /// Temperature of the chamber, in degrees Celsius.
    fn temperature_c(&self) -> i32 {
        let (sign, digits) = match self.group.strip_prefix('n') {
            Some(digits) => (-1, digits),
            None => (1, self.group.as_str()),
        };
        let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        sign * digits[..end].parse::<i32>().expect("a temperature")
    }

    /// Groups are in the order of their temperatures.
    fn group(&self) -> (i32, &str) {
        (self.temperature_c(), &self.group)
    }

    fn is_warm(&self) -> bool {
        self.temperature_c() >= 10
    }

    /// The sample at which half of the charge is drawn.
    fn middle(&self) -> usize {
        let last_pct = self.truth_pct.last().expect("samples");
        let half_pct = 0.5 * (100.0 + last_pct);
        self.truth_pct
            .iter()
            .position(|truth_pct| *truth_pct <= half_pct)
            .expect("a middle")
    }

    /// When the last load ends, in seconds.
    fn end_of_load_s(&self) -> f64 {
        let is_load = |sample: &&Sample| sample.current_a.is_some_and(|current_a| current_a > LOAD_A);
        self.samples.iter().rfind(is_load).expect("a load").t_s
    }
}

/// Linear interpolation in rows of time and value.
fn at(rows: &[[f64; 2]], t_s: f64) -> f64 {
    let next = rows.partition_point(|row| row[0] <= t_s).clamp(1, rows.len() - 1);
    let (before, next) = (&rows[next - 1], &rows[next]);
    let weight = ((t_s - before[0]) / (next[0] - before[0])).clamp(0.0, 1.0);
    before[1] + weight * (next[1] - before[1])
}

/// All recordings, by name; none without a folder.
fn recordings() -> &'static [Recording] {
    static RECORDINGS: OnceLock<Vec<Recording>> = OnceLock::new();
    RECORDINGS.get_or_init(|| {
        let Some(folder) = std::env::var_os("BATTERY_RECORDINGS") else {
            println!("skipped: BATTERY_RECORDINGS names no folder");
            return Vec::new();
        };
        let folder = Path::new(&folder);
        let files = fs::read_dir(folder).expect("the folder of BATTERY_RECORDINGS");
        let mut names: Vec<String> = files
            .filter_map(|file| Some(file.ok()?.file_name().to_str()?.strip_suffix(".csv")?.to_owned()))
            .collect();
        names.sort();
        let recordings: Vec<_> = names
            .iter()
            .filter_map(|name| Recording::read(folder, name))
            .collect();
        assert!(
            !recordings.is_empty(),
            "no recordings with a truth in {}",
            folder.display()
        );
        recordings
    })
}

/// RMS error of an estimate at each sample, of which those count that have one; infinite if fewer than nine in ten do.
fn rms_pct(samples: &[Sample], truth_pct: &[f64], estimate_pct: impl Fn(usize) -> Option<f64>) -> f64 {
    let scored = samples.partition_point(|sample| sample.t_s - samples[0].t_s < SCORED_FROM_S);
    let errors: Vec<f64> = (scored..samples.len())
        .filter_map(|number| Some(estimate_pct(number)? - truth_pct[number]))
        .collect();
    if errors.len() * 10 < (samples.len() - scored) * 9 {
        return f64::INFINITY;
    }
    root_mean_square(&errors)
}

/// RMS error of the remaining charge from a sample on.
fn score_from(start: usize, recording: &Recording, label_mah: f32, learnt: &LearntPack) -> f64 {
    let (samples, truth_pct) = (&recording.samples[start..], &recording.truth_pct[start..]);
    score(samples, truth_pct, label_mah, learnt)
}

fn score(samples: &[Sample], truth_pct: &[f64], label_mah: f32, learnt: &LearntPack) -> f64 {
    let mut estimates = Vec::with_capacity(samples.len());
    replay(samples, &li_ion_cell(label_mah), learnt, |_, _, battery| {
        estimates.push(battery.readings.remaining_pct);
    });
    rms_pct(samples, truth_pct, |number| estimates[number].map(f64::from))
}

/// RMS error of counting down from 100 % by the label, as ArduPilot does.
fn counting_score(recording: &Recording) -> f64 {
    let drawn_mah = drawn_mah(&recording.samples);
    rms_pct(&recording.samples, &recording.truth_pct, |number| {
        Some(100.0 * (1.0 - drawn_mah[number] / f64::from(LABEL_MAH)))
    })
}

/// What is known after each warm drive that teaches, with this label.
fn lessons(label_mah: f32) -> Vec<LearntPack> {
    let warm = recordings()
        .iter()
        .filter(|recording| recording.temperature_c() >= 25);
    let settings = li_ion_cell(label_mah);
    let taught =
        warm.map(|recording| replay(&recording.samples, &settings, &LearntPack::UNKNOWN, |_, _, _| {}));
    taught.filter(|learnt| learnt.capacity_mah().is_some()).collect()
}

/// The mean error over what each lesson makes of a recording.
fn mean(lessons: &[LearntPack], score: impl Fn(&LearntPack) -> f64) -> f64 {
    lessons.iter().map(score).sum::<f64>() / lessons.len() as f64
}

/// Asserts that the mean figure of each group is within the goal for its temperature. A single drive may exceed it by a
/// quarter: the goals are those of whole groups.
#[track_caller]
fn assert_means(what: &str, goal: impl Fn(i32) -> f64, figure: impl Fn(&Recording) -> f64) {
    let mut groups: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for recording in recordings() {
        let figure = figure(recording);
        println!("{what:32} {:32} {figure:6.2}", recording.name);
        groups.entry(recording.group()).or_default().push(figure);
    }
    let mut missed = Vec::new();
    for ((temperature_c, group), figures) in groups {
        let mean = figures.iter().sum::<f64>() / figures.len() as f64;
        let goal = goal(temperature_c);
        println!("{what:32} {group:>6}: mean {mean:5.2}, goal {goal:5.2}");
        let limit = if figures.len() == 1 { 1.25 * goal } else { goal };
        if mean.is_nan() || mean > limit {
            missed.push(format!("{group}: {mean:.2} instead of {goal:.2}"));
        }
    }
    assert!(missed.is_empty(), "{what}: {missed:?}");
}

#[test]
fn a_full_pack_is_estimated_as_well_as_by_counting() {
    assert_means(
        "from full, less counting",
        |_| 0.6,
        |recording| {
            let here = score_from(0, recording, LABEL_MAH, &LearntPack::UNKNOWN);
            let counting = counting_score(recording);
            println!("{:32} {here:.2}, by counting {counting:.2}", recording.name);
            here - counting
        },
    );
}

#[test]
fn one_warm_drive_teaches_the_pack_and_corrects_a_wrong_label() {
    let [less_mah, more_mah] = WRONG_LABELS_MAH;
    for (label_mah, goal) in [(LABEL_MAH, 1.0), (less_mah, 1.3), (more_mah, 1.3)] {
        let lessons = lessons(label_mah);
        assert!(recordings().is_empty() || !lessons.is_empty(), "no drive teaches");
        let what = format!("from full, label {label_mah}, learnt");
        let score =
            |recording: &Recording| mean(&lessons, |learnt| score_from(0, recording, label_mah, learnt));
        assert_means(&what, |_| goal, score);
    }
}

#[test]
fn a_pack_found_half_empty_is_estimated_by_its_voltage() {
    let goal = |temperature_c: i32| match temperature_c {
        0.. => 8.0,
        -10.. => 10.0,
        _ => 15.0,
    };
    assert_means("half empty", goal, |recording| {
        score_from(recording.middle(), recording, LABEL_MAH, &LearntPack::UNKNOWN)
    });
}

#[test]
fn a_learnt_pack_found_half_empty_is_estimated_better() {
    let lessons = lessons(LABEL_MAH);
    let goal = |temperature_c: i32| match temperature_c {
        0.. => 5.1,
        -10.. => 7.0,
        _ => 11.5,
    };
    assert_means("half empty, learnt", goal, |recording| {
        mean(&lessons, |learnt| {
            score_from(recording.middle(), recording, LABEL_MAH, learnt)
        })
    });
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
        assert_means(what, goal, |recording| {
            let mut samples = without_current(&recording.samples);
            samples.iter_mut().for_each(|sample| sample.armed = armed);
            score(&samples, &recording.truth_pct, LABEL_MAH, &LearntPack::UNKNOWN)
        });
    }
}

/// Share of the time, in percent, in which the truth lies within two of the stated standard deviations.
fn coverage_pct(samples: &[Sample], truth_pct: &[f64], learnt: &LearntPack) -> f64 {
    let mut within = Vec::new();
    replay(samples, &li_ion_cell(LABEL_MAH), learnt, |number, _, battery| {
        let readings = battery.readings;
        let estimate = readings.remaining_pct.zip(readings.remaining_sigma_pct);
        if let Some((remaining_pct, sigma_pct)) = estimate
            && samples[number].t_s - samples[0].t_s >= SCORED_FROM_S
        {
            let error_pct = f64::from(remaining_pct) - truth_pct[number];
            within.push(error_pct.abs() <= 2.0 * f64::from(sigma_pct));
        }
    });
    100.0 * within.iter().filter(|is_within| **is_within).count() as f64 / within.len() as f64
}

#[test]
fn the_truth_is_within_two_standard_deviations() {
    if recordings().is_empty() {
        return;
    }
    let lessons = lessons(LABEL_MAH);
    let from = |what: &str, start: fn(&Recording) -> usize, lessons: &[LearntPack]| {
        let of = |recording: &Recording| {
            let start = start(recording);
            mean(lessons, |learnt| {
                coverage_pct(&recording.samples[start..], &recording.truth_pct[start..], learnt)
            })
        };
        (what.to_owned(), recordings().iter().map(of).collect::<Vec<_>>())
    };
    let by_voltage = |recording: &Recording| {
        let samples = without_current(&recording.samples);
        coverage_pct(&samples, &recording.truth_pct, &LearntPack::UNKNOWN)
    };
    let unknown = [LearntPack::UNKNOWN];
    let rows = [
        from("from full", |_| 0, &unknown),
        from("from full, learnt", |_| 0, &lessons),
        from("half empty", Recording::middle, &unknown),
        from("half empty, learnt", Recording::middle, &lessons),
        (
            "voltage only".to_owned(),
            recordings().iter().map(by_voltage).collect(),
        ),
    ];
    // Without a current the sag in the cold is unknown.
    for ((what, shares), least) in rows.into_iter().zip([90.0, 90.0, 90.0, 90.0, 85.0]) {
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        println!("{what:32} within two standard deviations {mean:.1} % of the time: {shares:.0?}");
        assert!(mean >= least, "{what}: {mean:.1} %: {shares:.0?}");
    }
}

/// When what is usable falls to 15 %, in seconds.
fn warned_s(recording: &Recording) -> Option<f64> {
    let (samples, settings) = (&recording.samples, li_ion_cell(LABEL_MAH));
    let mut warned_s = None;
    replay(samples, &settings, &LearntPack::UNKNOWN, |number, _, battery| {
        let usable_pct = battery.readings.usable_pct;
        if usable_pct.is_some_and(|usable_pct| usable_pct <= 15.0) {
            warned_s.get_or_insert(samples[number].t_s);
        }
    });
    warned_s
}

#[test]
fn usable_charge_warns_minutes_before_a_warm_pack_collapses() {
    let mut leads: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for recording in recordings() {
        let lead_s = warned_s(recording).map_or(f64::NEG_INFINITY, |t_s| recording.end_of_load_s() - t_s);
        let minutes = lead_s / 60.0;
        println!("{}: warned {minutes:.1} minutes before the end", recording.name);
        if recording.is_warm() {
            leads.entry(recording.group()).or_default().push(minutes);
        }
    }
    for ((temperature_c, group), mut minutes) in leads {
        minutes.sort_by(f64::total_cmp);
        let median = minutes[minutes.len() / 2];
        println!("{group}: warned {median:.1} minutes before the end in the median");
        let least = if temperature_c >= 25 { 4.0 } else { 2.0 };
        assert!(median >= least, "{group}: {minutes:?}");
    }
}

#[test]
fn a_half_empty_pack_believed_full_is_found_out() {
    let mut missed = Vec::new();
    for recording in recordings() {
        let (samples, settings) = (&recording.samples, li_ion_cell(LABEL_MAH));
        let half = recording.middle();
        let settled = samples[half].t_s + 360.0;
        let mut largest_pct: f64 = 0.0;
        let mut after_six_minutes_pct = None;
        replay(
            samples,
            &settings,
            &LearntPack::UNKNOWN,
            |number, monitor, battery| {
                if number == half {
                    monitor.reset(&mut { *battery }, LoadState::On, 100.0, &settings);
                }
                if samples[number].t_s >= settled {
                    let remaining_pct = battery.readings.remaining_pct;
                    let remaining_pct = remaining_pct.map_or(f64::INFINITY, f64::from);
                    let error_pct = remaining_pct - recording.truth_pct[number];
                    after_six_minutes_pct.get_or_insert(error_pct);
                    largest_pct = largest_pct.max(error_pct.abs());
                }
            },
        );
        let error_pct = after_six_minutes_pct.expect("a longer drive");
        println!(
            "{}: half empty, believed full: {error_pct:.1} % after 6 minutes, then up to {largest_pct:.1} %",
            recording.name
        );
        if recording.is_warm() && error_pct.abs() > 10.0 {
            missed.push(format!("{}: {error_pct:.1} %", recording.name));
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// A drive as a worse sensor would have recorded it.
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
    /// The samples that it would have recorded, with the truth at each.
    fn of(self, recording: &Recording) -> (Vec<Sample>, Vec<f64>) {
        let samples = &recording.samples;
        let start_s = samples[0].t_s;
        let last_s = samples.last().expect("samples").t_s;
        let gap_s = start_s + (last_s - start_s) / 3.0;
        let mut random = Random(1);
        let mut next_s = start_s;
        let mut seen = Vec::new();
        for (number, sample) in samples.iter().enumerate() {
            let elapsed_s = sample.t_s - start_s;
            let is_lost = match self {
                Self::Slow => sample.t_s < next_s,
                Self::ShortGaps => (300.0..330.0).contains(&(elapsed_s % 600.0)),
                Self::LongGap => (gap_s..gap_s + 120.0).contains(&sample.t_s),
                Self::Noisy | Self::LateCurrent => false,
            };
            if is_lost {
                continue;
            }
            next_s = sample.t_s + 9.95;
            let mut sample = *sample;
            match self {
                Self::Noisy => {
                    sample.voltage_v += 0.008 * random.normal();
                    sample.current_a = sample
                        .current_a
                        .map(|current_a| current_a + 0.1 * random.normal());
                }
                Self::LateCurrent => sample.current_a = samples[number.saturating_sub(3)].current_a,
                Self::Slow | Self::ShortGaps | Self::LongGap => {}
            }
            seen.push((sample, recording.truth_pct[number]));
        }
        seen.into_iter().unzip()
    }
}

/// A sequence of numbers that is always the same.
struct Random(u64);

impl Random {
    /// The sum of twelve uniform ones, less its mean, has a standard deviation of 1.
    fn normal(&mut self) -> f32 {
        let uniform = |_| {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 40) as f32 / (1 << 24) as f32
        };
        (0..12).map(uniform).sum::<f32>() - 6.0
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
        let goal = |_: i32| 5.0;
        assert_means(&format!("{sensor:?}"), goal, |recording| {
            let (samples, truth_pct) = sensor.of(recording);
            score(&samples, &truth_pct, LABEL_MAH, &LearntPack::UNKNOWN)
        });
    }
}
