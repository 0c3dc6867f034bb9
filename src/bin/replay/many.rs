//! Many logs at once, for a table of their drives or the life of each pack.
//!
//! All processors work, each on a log at a time. The rows are in the order of the logs' paths, however many processors there are.

use std::fs::{self, File};
use std::path::Path;

use indicatif::ProgressBar;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use rover_battmon::battery::LearntPack;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;

use crate::files::{Failure, Files};
use crate::run::{self, Assignment, Replay};
use crate::table::{self, Row};
use crate::trace::Inputs;
use crate::{Arguments, history};

/// The longest log that is read, in bytes. The board's have 1 MB at most, and ArduPilot's seldom more than 100 MB; reading this
/// much takes a processor some seconds.
const LONGEST_BYTES: u64 = 256 << 20;

/// Writes what was asked for.
///
/// # Errors
/// What is wrong with an argument, or why a file can't be written, in words.
pub fn replay(arguments: &Arguments) -> Result<(), String> {
    check(&arguments.assignments)?;
    let (rows, failures) = read(arguments);
    for Failure { path, reason } in &failures {
        eprintln!("{}: {reason}", path.display());
    }
    let about = |path: &Path, error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    if let Some(path) = &arguments.table {
        table::write(path, &rows, &failures).map_err(|error| about(path, &error))?;
        eprintln!("wrote {} with {} rows", path.display(), rows.len());
    }
    if let Some(path) = &arguments.history {
        fs::write(path, history::page(&rows)).map_err(|error| about(path, &error))?;
        eprintln!("wrote {}", path.display());
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
    table::rows(&path.to_string_lossy(), || File::open(path), what_if)
}
