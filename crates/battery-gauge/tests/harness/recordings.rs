//! Measured drives, which are not part of the repository.
//!
//! `BATTERY_RECORDINGS` names a folder with `{cell}….csv` (`t_s,voltage_v,current_a`, discharge is positive) and `.truth.csv`
//! (`t_s,soc`); `cells/{cell}….csv.gz` with a fourth column `true_soc`; `aged/{cell}_{number}….csv.gz` without a truth, whose
//! load ends where the cell is empty.

use std::fs::{self, File};
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use battery_gauge::Chemistry;
use flate2::read::GzDecoder;

use crate::drive::{Cell, Drive, End, Origin};
use crate::sample::{Sample, rows};

/// Temperature at which a cell's drives were recorded.
#[derive(Clone, Copy, Debug)]
enum Temperature {
    /// The names have it, with an `n` for minus.
    Named,
    /// In degrees Celsius.
    Fixed(i32),
}

const fn cell(name: &'static str, chemistry: Chemistry, label_ah: Option<f64>, critical_v: f32) -> Cell {
    Cell {
        origin: Origin::Recorded,
        name,
        chemistry,
        label_ah,
        critical_v,
        end: End::Critical,
        is_life: false,
    }
}

/// Cells as their makers label them. A longer name stands before its begin.
const CELLS: [(Cell, Temperature); 10] = [
    (
        cell(FIRST_CELL, Chemistry::LiIon, Some(2.9), 3.0),
        Temperature::Named,
    ),
    (
        cell("lifepo4", Chemistry::LiFe, Some(2.3), 2.8),
        Temperature::Named,
    ),
    (cell("lco", Chemistry::LiIon, Some(5.0), 3.0), Temperature::Named),
    (
        cell(CONSTANT_LOAD, Chemistry::LiIon, Some(4.2), 3.0),
        Temperature::Fixed(25),
    ),
    (cell("lipo", Chemistry::LiPo, None, 3.4), Temperature::Fixed(25)),
    (cell("nimh", Chemistry::NiMh, None, 1.0), Temperature::Fixed(25)),
    (
        Cell {
            end: End::LastLoad,
            is_life: true,
            ..cell(COLD_LIFE, Chemistry::LiIon, Some(2.0), 2.5)
        },
        Temperature::Fixed(4),
    ),
    (
        Cell {
            is_life: true,
            ..cell(COBALT_LIFE, Chemistry::LiPo, Some(1.1), 3.4)
        },
        Temperature::Fixed(24),
    ),
    (
        Cell {
            end: End::LastLoad,
            is_life: true,
            ..cell(WARM_LIFE, Chemistry::LiIon, Some(2.0), 2.7)
        },
        Temperature::Fixed(24),
    ),
    (
        Cell {
            end: End::LastLoad,
            is_life: true,
            ..cell(LARGE_CELL, Chemistry::LiIon, Some(33.1), 2.5)
        },
        Temperature::Fixed(24),
    ),
];

/// The cell that was recorded at the most temperatures.
pub const FIRST_CELL: &str = "pan18650pf";
/// One whose load is constant.
pub const CONSTANT_LOAD: &str = "liion";
/// Cells recorded over their lives.
pub const COLD_LIFE: &str = "aged_cold";
pub const COBALT_LIFE: &str = "aged_cs2";
pub const WARM_LIFE: &str = "b0";
/// A new one, with loads of 1 to 3 C.
pub const LARGE_CELL: &str = "leaf";

/// All drives, in the order of their names; none without a folder.
pub fn drives() -> Vec<Drive> {
    let Some(folder) = std::env::var_os("BATTERY_RECORDINGS").map(PathBuf::from) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = ["", "cells", "aged"]
        .iter()
        .filter_map(|part| fs::read_dir(folder.join(part)).ok())
        .flatten()
        .map(|file| file.expect("a file").path())
        .collect();
    paths.sort();
    let drives: Vec<Drive> = paths.iter().filter_map(|path| read(path)).collect();
    assert!(!drives.is_empty(), "no recordings in {}", folder.display());
    drives
}

fn read(path: &Path) -> Option<Drive> {
    let name = path.file_name()?.to_str()?;
    let (cell, temperature) = *CELLS.iter().find(|(cell, _)| name.starts_with(cell.name))?;
    let stem = name
        .strip_suffix(".csv.gz")
        .or_else(|| name.strip_suffix(".csv"))?;
    let text = text(path);
    let (samples, truth_pct) = if text.starts_with("t_s,voltage_v,current_a,true_soc") {
        with_truth(&text)
    } else if name.ends_with(".gz") {
        (samples(&text), None)
    } else {
        let truth: Vec<[f64; 2]> =
            rows(&fs::read_to_string(path.with_file_name(format!("{stem}.truth.csv"))).ok()?).collect();
        let samples = samples(&text);
        let truth_pct = samples
            .iter()
            .map(|sample| 100.0 * at(&truth, sample.t_s))
            .collect();
        (samples, Some(truth_pct))
    };
    let rest = stem[cell.name.len()..].trim_start_matches('_');
    let (group, temperature_c) = match temperature {
        Temperature::Fixed(temperature_c) => (rest.split('_').next().unwrap_or_default(), temperature_c),
        Temperature::Named => rest.split('_').find_map(|part| Some((part, celsius(part)?)))?,
    };
    let number = stem.split('_').filter_map(|part| part.parse().ok()).next_back();
    // All drives of a life are one group; of others, those with the same conditions.
    let group = match cell.is_life {
        true => cell_of_life(stem),
        false if name.contains("trise") => format!("{}_{group}_rising", cell.name),
        false => format!("{}_{group}", cell.name),
    };
    Some(Drive::new(
        cell,
        group,
        number.unwrap_or(0),
        temperature_c,
        samples,
        truth_pct,
    ))
}

/// The part of a name in front of a drive's number.
fn cell_of_life(stem: &str) -> String {
    let parts: Vec<&str> = stem.split('_').collect();
    let digits = |part: &&str| part.chars().all(|c| c.is_ascii_digit());
    let number = parts.iter().position(digits).unwrap_or(parts.len());
    parts[..number].join("_")
}

/// `25`, `5c`, `n10c`.
fn celsius(part: &str) -> Option<i32> {
    let (sign, digits) = match part.strip_prefix('n') {
        Some(digits) => (-1, digits),
        None => (1, part),
    };
    Some(sign * digits.strip_suffix('c').unwrap_or(digits).parse::<i32>().ok()?)
}

fn text(path: &Path) -> String {
    let mut text = String::new();
    let mut file = File::open(path).expect("a recording");
    let read = if path.extension().is_some_and(|ending| ending == "gz") {
        GzDecoder::new(file).read_to_string(&mut text)
    } else {
        file.read_to_string(&mut text)
    };
    read.expect("a recording");
    text
}

fn samples(text: &str) -> Vec<Sample> {
    let measured = |[t_s, voltage_v, current_a]: [f64; 3]| Sample::measured(t_s, voltage_v, current_a, true);
    let mut samples: Vec<Sample> = rows(text).map(measured).collect();
    samples.dedup_by(|next, before| next.t_s <= before.t_s);
    samples
}

/// Samples with a truth beside them, which may be missing.
fn with_truth(text: &str) -> (Vec<Sample>, Option<Vec<f64>>) {
    let line = |line: &str| {
        let mut fields = line.split(',').map(|field| field.parse::<f64>());
        let mut next = || fields.next().expect("four columns");
        let [t_s, voltage_v, current_a] = [next(), next(), next()].map(|number| number.expect("a number"));
        let truth_pct = 100.0 * next().unwrap_or(f64::NAN);
        (Sample::measured(t_s, voltage_v, current_a, true), truth_pct)
    };
    let (samples, truth_pct) = text.lines().skip(1).map(line).unzip();
    (samples, Some(truth_pct))
}

/// Linear interpolation in rows of time and value.
fn at(rows: &[[f64; 2]], t_s: f64) -> f64 {
    let next = rows.partition_point(|row| row[0] <= t_s).clamp(1, rows.len() - 1);
    let (before, next) = (&rows[next - 1], &rows[next]);
    let weight = ((t_s - before[0]) / (next[0] - before[0])).clamp(0.0, 1.0);
    before[1] + weight * (next[1] - before[1])
}

/// The drives of a life with those between two recorded ones, interpolated.
pub fn with_those_between(recorded: &[&Drive]) -> Vec<Drive> {
    let mut drives = vec![recorded[0].clone()];
    for pair in recorded.windows(2) {
        let numbers = pair[0].number + 1..pair[1].number;
        drives.extend(numbers.map(|number| between(pair[0], pair[1], number)));
        drives.push(pair[1].clone());
    }
    drives
}

fn between(before: &Drive, after: &Drive, number: usize) -> Drive {
    let weight = (number - before.number) as f64 / (after.number - before.number) as f64;
    let mix = |here: f64, there: f64| here + (there - here) * weight;
    let mut samples: Vec<Sample> = Vec::new();
    for (here, there) in parts(before).into_iter().zip(parts(after)) {
        if here.is_empty() || there.is_empty() {
            continue;
        }
        let seconds = |drive: &Drive, part: &Range<usize>| {
            drive.samples[part.end - 1].t_s - drive.samples[part.start].t_s
        };
        let duration_s = mix(seconds(before, &here), seconds(after, &there)).round() as u32;
        let begin_s = samples.last().map_or(0.0, |last| last.t_s + 1.0);
        samples.extend((0..duration_s).map(|second| {
            let position = (f64::from(second) + 0.5) / f64::from(duration_s);
            let at = |drive: &Drive, part: &Range<usize>| {
                let index = part.start as f64 + position * (part.len() - 1) as f64;
                drive.samples[index.round() as usize]
            };
            let (here, there) = (at(before, &here), at(after, &there));
            let current_a = |sample: &Sample| f64::from(sample.current_a.expect("a current"));
            Sample::measured(
                begin_s + f64::from(second),
                mix(f64::from(here.voltage_v), f64::from(there.voltage_v)),
                mix(current_a(&here), current_a(&there)),
                true,
            )
        }));
    }
    Drive::new(
        before.cell,
        before.group.clone(),
        number,
        before.temperature_c,
        samples,
        None,
    )
}

/// The rest before the load, the load, and the rest after it.
fn parts(drive: &Drive) -> [Range<usize>; 3] {
    let load_a = 0.1 * drive.capacity_ah as f32;
    let is_load = |sample: &Sample| sample.current_a.is_some_and(|current_a| current_a > load_a);
    let first = drive.samples.iter().position(is_load).expect("a load");
    let end = drive.samples.iter().rposition(is_load).expect("a load") + 1;
    [0..first, first..end, end..drive.samples.len()]
}
