//! Errors over the life of other cells, whose drives are not part of the repository.
//!
//! `BATTERY_RECORDINGS` names a folder whose `aged` has `{cell}_{number}….csv.gz` (`t_s,voltage_v,current_a`): drives of one
//! Li-ion cell with constant currents until the voltage at which their tests end, in the order of their numbers, with rests
//! before and after. Without it these tests do nothing. `docs/battery-model.md` lists their figures:
//!
//! `BATTERY_RECORDINGS=folder cargo test -p battery-gauge --test battery_traces lives:: -- --nocapture`

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use battery_gauge::{LearntPack, PackSettings, Thresholds};
use flate2::read::GzDecoder;

use super::replay::{Sample, drawn_mah, li_ion_cell, replay, root_mean_square, rows};

/// A current above this is a load, in capacities per hour.
const LOAD_PER_H: f32 = 0.1;

/// A charge that such a test leaves in a cell, relative to its capacity: assumed.
const LEFT_AT_CUT_OFF: f64 = 0.05;

/// The usable charge that warns, in percent.
const LOW_PCT: f32 = 15.0;

/// A drive with the sample at which its load begins, and the one before which it ends.
#[derive(Clone)]
struct Drive {
    number: usize,
    samples: Vec<Sample>,
    load: std::ops::Range<usize>,
}

impl Drive {
    fn new(number: usize, samples: Vec<Sample>, label_mah: f32) -> Self {
        let load_a = LOAD_PER_H * label_mah / 1000.0;
        let is_load = |sample: &Sample| sample.current_a.is_some_and(|current_a| current_a > load_a);
        let first = samples.iter().position(is_load).expect("a load");
        let last = samples.iter().rposition(is_load).expect("a load");
        Self {
            number,
            samples,
            load: first..last + 1,
        }
    }

    fn read(path: &Path, cell: &str, label_mah: f32) -> Option<Self> {
        let name = path.file_name()?.to_str()?.strip_suffix(".csv.gz")?;
        let digits = name.strip_prefix(cell)?.strip_prefix('_')?.split('_').next()?;
        let mut text = String::new();
        let file = File::open(path).expect("a recording");
        GzDecoder::new(file)
            .read_to_string(&mut text)
            .expect("a recording");
        let samples = rows(&text)
            .map(|[t_s, voltage_v, current_a]: [f64; 3]| Sample::measured(t_s, voltage_v, current_a, true))
            .collect();
        Some(Self::new(digits.parse().ok()?, samples, label_mah))
    }

    /// The sample at a share of the rest before (0 to 1), the load (to 2) and the rest after (to 3).
    fn at(&self, position: f64) -> Sample {
        let ends = [0, self.load.start, self.load.end - 1, self.samples.len() - 1].map(|end| end as f64);
        let part = (position as usize).min(2);
        let index = ends[part] + (ends[part + 1] - ends[part]) * (position - part as f64);
        self.samples[index.round() as usize]
    }

    /// A drive between this one and `next`.
    fn between(&self, next: &Self, number: usize, label_mah: f32) -> Self {
        let weight = (number - self.number) as f64 / (next.number - self.number) as f64;
        let mix = |here: f64, there: f64| here + (there - here) * weight;
        let mut samples: Vec<Sample> = Vec::new();
        for part in 0..3 {
            let seconds =
                |drive: &Self| drive.at(f64::from(part) + 0.9999).t_s - drive.at(f64::from(part)).t_s;
            let duration_s = mix(seconds(self), seconds(next)).round() as u32;
            let begin_s = samples.last().map_or(0.0, |last| last.t_s + 1.0);
            samples.extend((0..duration_s).map(|second| {
                let position = f64::from(part) + (f64::from(second) + 0.5) / f64::from(duration_s);
                let (here, there) = (self.at(position), next.at(position));
                let current = |sample: &Sample| f64::from(sample.current_a.expect("a current"));
                Sample {
                    t_s: begin_s + f64::from(second),
                    voltage_v: mix(f64::from(here.voltage_v), f64::from(there.voltage_v)) as f32,
                    current_a: Some(mix(current(&here), current(&there)) as f32),
                    ..here
                }
            }));
        }
        Self::new(number, samples, label_mah)
    }
}

/// All drives of a cell, those between two recorded ones interpolated; none without a folder.
fn life(cell: &str, label_mah: f32) -> Vec<Drive> {
    let Some(folder) = std::env::var_os("BATTERY_RECORDINGS") else {
        println!("skipped: BATTERY_RECORDINGS names no folder");
        return Vec::new();
    };
    let files = fs::read_dir(Path::new(&folder).join("aged")).expect("the folder of drives");
    let mut recorded: Vec<Drive> = files
        .filter_map(|file| Drive::read(&file.expect("a file").path(), cell, label_mah))
        .collect();
    recorded.sort_by_key(|drive| drive.number);
    let mut drives = recorded[..1].to_vec();
    for pair in recorded.windows(2) {
        let numbers = pair[0].number + 1..pair[1].number;
        drives.extend(numbers.map(|number| pair[0].between(&pair[1], number, label_mah)));
        drives.push(pair[1].clone());
    }
    drives
}

/// Figures of a drive, from the begin of its load to the cut-off, in percent, minutes and shares.
const FIGURES: [&str; 7] = [
    "usable charge, RMS",
    "state of charge, RMS",
    "at cut-off",
    "LOW ahead, min",
    "time left ten minutes before, min",
    "within two deviations",
    "usable charge within two",
];

/// The value of each figure.
type Score = [f64; FIGURES.len()];

/// Drives with what was learnt before, which is carried on.
fn drive(drive: &Drive, settings: &PackSettings, learnt: &mut LearntPack) -> Score {
    let loaded = &drive.samples[drive.load.clone()];
    let drawn_mah = drawn_mah(loaded);
    let total_mah = *drawn_mah.last().expect("a load");
    let cut_off_s = loaded[loaded.len() - 1].t_s;
    let (mut usable, mut remaining) = (Vec::new(), Vec::new());
    let (mut within, mut usable_within) = (0, 0);
    let (mut low_s, mut ten_minutes_min, mut at_cut_off_pct) = (cut_off_s, f64::NAN, f64::NAN);
    *learnt = replay(&drive.samples, settings, learnt, |number, _, battery| {
        if number == drive.load.start || !drive.load.contains(&number) {
            return;
        }
        let sample = &drive.samples[number];
        let drawn = drawn_mah[number - drive.load.start] / total_mah;
        let readings = &battery.readings;
        let remaining_with_sigma = readings.remaining_pct.zip(readings.remaining_sigma_pct);
        let usable_with_sigma = readings.usable_pct.zip(readings.usable_sigma_pct);
        let (Some((remaining_pct, sigma_pct)), Some((usable_pct, usable_sigma_pct))) =
            (remaining_with_sigma, usable_with_sigma)
        else {
            return;
        };
        let error_pct = f64::from(remaining_pct) - 100.0 * (1.0 - drawn * (1.0 - LEFT_AT_CUT_OFF));
        remaining.push(error_pct);
        let usable_error_pct = f64::from(usable_pct) - 100.0 * (1.0 - drawn);
        usable.push(usable_error_pct);
        within += u32::from(error_pct.abs() <= 2.0 * f64::from(sigma_pct));
        usable_within += u32::from(usable_error_pct.abs() <= 2.0 * f64::from(usable_sigma_pct));
        at_cut_off_pct = f64::from(remaining_pct);
        if usable_pct <= LOW_PCT {
            low_s = low_s.min(sample.t_s);
        }
        if sample.t_s <= cut_off_s - 600.0 {
            let left_s = readings.time_remaining_s.map_or(f64::NAN, f64::from);
            ten_minutes_min = left_s / 60.0;
        }
    });
    [
        root_mean_square(&usable),
        root_mean_square(&remaining),
        at_cut_off_pct,
        (cut_off_s - low_s) / 60.0,
        ten_minutes_min,
        f64::from(within) / remaining.len() as f64,
        f64::from(usable_within) / remaining.len() as f64,
    ]
}

/// Scores of a cell's drives in their order.
fn scores(cell: &str, label_mah: f32, cut_off_v: f32) -> Vec<Score> {
    let mut settings = li_ion_cell(label_mah);
    settings.failsafe.timer_s = Some(10.0);
    settings.failsafe.low = Thresholds::default();
    settings.failsafe.critical.voltage_v = Some(cut_off_v);
    let mut learnt = LearntPack::UNKNOWN;
    let drives = life(cell, label_mah);
    let scores = drives.iter().map(|recorded| {
        let score = drive(recorded, &settings, &mut learnt);
        let capacity_mah = learnt.capacity_mah();
        println!("{cell} {:3} {score:6.2?} {capacity_mah:?}", recorded.number);
        score
    });
    scores.collect()
}

#[test]
fn an_aged_cell_is_known() {
    let scores = scores("b0005", 2000.0, 2.7);
    let half = &scores[scores.len() / 2..];
    if half.is_empty() {
        return;
    }
    let means: Score =
        std::array::from_fn(|figure| half.iter().map(|score| score[figure]).sum::<f64>() / half.len() as f64);
    for (name, mean) in FIGURES.iter().zip(&means) {
        println!("second half of life, {name:34} {mean:6.2}");
    }
    let [
        usable,
        remaining,
        at_cut_off,
        low,
        ten_minutes,
        within,
        usable_within,
    ] = means;
    assert!(
        usable <= 4.0 && remaining <= 3.2 && at_cut_off <= 10.5,
        "{means:?}"
    );
    assert!(
        low >= 4.0 && (8.0..=13.0).contains(&ten_minutes) && within.min(usable_within) >= 0.9,
        "{means:?}"
    );
}

#[test]
fn heavier_drives_do_not_bend_the_curve() {
    let scores = scores("leaf", 33_100.0, 2.5);
    let remaining_rms_pct = scores.iter().skip(1).map(|[_, remaining, ..]| *remaining);
    let worst = remaining_rms_pct.fold(0.0, f64::max);
    println!("worst of all but the first {worst:.2}");
    assert!(worst <= 5.3, "{worst}");
}
