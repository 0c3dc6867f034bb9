//! A table of the drives in many logs, a row for each pack and drive: what its columns are is in [`columns`].
//!
//! All processors work, each on a log at a time. The rows are in the order of the logs' paths, however many processors there are.

mod columns;
mod drives;
mod files;
mod pack_drives;
mod parquet;
mod row;
mod statistics;

pub use files::is_log;
pub use row::Row;

use std::fs::{self, File};
use std::path::Path;

use indicatif::ProgressBar;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use rover_battmon::battery::LearntPack;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;

use self::files::{Failure, Files};
use crate::Arguments;
use crate::run::{self, Assignment, Inputs, Replay};

/// The longest log that is read, in bytes. The board's have 1 MB at most, and ArduPilot's seldom more than 100 MB; reading this
/// much takes a processor some seconds.
const LONGEST_BYTES: u64 = 256 << 20;

/// Writes the table.
///
/// # Errors
/// What is wrong with an argument, or why the table can't be written, in words.
pub fn replay(arguments: &Arguments) -> Result<(), String> {
    check(&arguments.assignments)?;
    let (rows, failures) = read(arguments);
    for Failure { path, reason } in &failures {
        eprintln!("{}: {reason}", path.display());
    }
    if let Some(path) = &arguments.table {
        write(path, &rows, &failures)?;
    }
    Ok(())
}

/// Whether these parameters can be set, and replayed, in any log.
fn check(assignments: &[Assignment]) -> Result<(), String> {
    let measured = Inputs {
        voltage: true,
        current: true,
    };
    for pack in Pack::ALL {
        let parameters = run::assign(Parameters::defaults(), assignments, pack, measured)?;
        Replay::new(pack, &parameters, LearntPack::UNKNOWN)?;
    }
    Ok(())
}

/// All rows, and what gives none.
fn read(arguments: &Arguments) -> (Vec<Row>, Vec<Failure>) {
    let Files {
        logs, mut failures, ..
    } = Files::find(&arguments.paths);
    // It is hidden unless standard error is a terminal.
    let progress = ProgressBar::new(logs.len() as u64);
    let results: Vec<_> = logs
        .par_iter()
        .map(|path| {
            let rows = read_log(path, &arguments.assignments);
            progress.inc(1);
            rows
        })
        .collect();
    progress.finish_and_clear();
    let mut rows = vec![];
    for (path, result) in logs.into_iter().zip(results) {
        match result {
            Ok(more) => rows.extend(more),
            Err(reason) => failures.push(Failure { path, reason }),
        }
    }
    (rows, failures)
}

fn read_log(path: &Path, what_if: &[Assignment]) -> Result<Vec<Row>, String> {
    let file = fs::metadata(path).map_err(|error| error.to_string())?;
    if !file.is_file() {
        return Err("no file".into());
    }
    if file.len() > LONGEST_BYTES {
        return Err(format!("larger than {} MiB", LONGEST_BYTES >> 20));
    }
    drives::rows(&path.to_string_lossy(), || File::open(path), what_if)
}

/// Writes the table, and beside it what is not in it: that file is there without any failure, too, so that it is never that of
/// another run.
fn write(path: &Path, rows: &[Row], failures: &[Failure]) -> Result<(), String> {
    let beside = path.with_extension("failures.csv");
    let about = |path: &Path, error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let file = File::create(path).map_err(|error| about(path, &error))?;
    parquet::write(rows, file).map_err(|error| about(path, &error))?;
    fs::write(&beside, csv(failures)).map_err(|error| about(&beside, &error))?;
    eprintln!("wrote {} with {} rows", path.display(), rows.len());
    eprintln!("wrote {} with {} rows", beside.display(), failures.len());
    Ok(())
}

fn csv(failures: &[Failure]) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let lines = failures
        .iter()
        .map(|Failure { path, reason }| format!("{},{}\n", quoted(&path.to_string_lossy()), quoted(reason)));
    format!("path,reason\n{}", lines.collect::<String>())
}
