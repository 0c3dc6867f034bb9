//! Many logs at once, for a table of their drives or the life of each pack.
//!
//! All processors work, each on a log at a time. The rows are in the order of the logs' paths, however many processors there are.

use std::fs;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use rover_battmon::battery::LearntPack;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;

use crate::arguments::Arguments;
use crate::assignments::Assignment;
use crate::files::{Failure, Files};
use crate::recording::LogFormat;
use crate::run::{self, Replay};
use crate::table::{self, Drives, Row};
use crate::trace::Inputs;
use crate::words::{about, copies, shown};
use crate::{copies, history, outputs};

/// Results of many logs.
struct Found {
    rows: Vec<Row>,
    failures: Vec<Failure>,
    /// Logs with readings whose times run backwards.
    backward: Vec<PathBuf>,
}

/// Writes what was asked for.
///
/// # Errors
/// An error of an argument, or of a file that can't be written, in words; and if there is no row, so that what a folder that is
/// not mounted lacks replaces no earlier output.
pub fn replay(arguments: &Arguments) -> Result<(), String> {
    check(&arguments.assignments)?;
    for path in &arguments.paths {
        fs::metadata(path).map_err(|error| about(path, &error))?;
    }
    let mut files = Files::find(&arguments.paths);
    outputs::check(arguments, &files.logs)?;
    let left_out = copies::take_out(&mut files.logs);
    let found = read(files, &arguments.assignments);
    for Failure { path, reason } in &found.failures {
        eprintln!("{}: {reason}", shown(path));
    }
    for path in &found.backward {
        eprintln!("{}: times run backwards", shown(path));
    }
    if left_out > 0 {
        eprintln!("left out {} of logs", copies(left_out));
    }
    if found.rows.is_empty() {
        return Err("no row: nothing was written".into());
    }
    write(arguments, &found)
}

fn write(arguments: &Arguments, found: &Found) -> Result<(), String> {
    let Found { rows, failures, .. } = found;
    if let Some(path) = &arguments.table {
        table::write(path, rows, failures).map_err(|error| about(path, &error))?;
        eprintln!("wrote {} with {} rows", shown(path), rows.len());
    }
    if let Some(path) = &arguments.history {
        fs::write(path, history::page(rows)).map_err(|error| about(path, &error))?;
        eprintln!("wrote {}", shown(path));
    }
    Ok(())
}

/// Whether these parameters can be set, and replayed, in any log.
fn check(assignments: &[Assignment]) -> Result<(), String> {
    let measured = Inputs {
        voltage: true,
        current: true,
    };
    run::check_packs(assignments, &Pack::ALL)?;
    for pack in Pack::ALL {
        let parameters = run::assign(Parameters::defaults(), assignments, pack, measured)?;
        Replay::new(pack, &parameters, assignments, LearntPack::UNKNOWN)?;
    }
    Ok(())
}

fn read(files: Files, what_if: &[Assignment]) -> Found {
    let Files { logs, failures, .. } = files;
    // It is hidden unless standard error is a terminal.
    let progress = ProgressBar::new(logs.len() as u64);
    let results: Vec<_> = logs
        .par_iter()
        .map(|path| {
            let drives = read_log(path, what_if);
            progress.inc(1);
            drives
        })
        .collect();
    progress.finish_and_clear();
    let mut found = Found {
        rows: vec![],
        failures,
        backward: vec![],
    };
    for (path, result) in logs.into_iter().zip(results) {
        match result {
            Ok(Drives { rows, backward_steps }) => {
                found.rows.extend(rows);
                if backward_steps > 0 {
                    found.backward.push(path);
                }
            }
            Err(reason) => found.failures.push(Failure { path, reason }),
        }
    }
    found
}

fn read_log(path: &Path, what_if: &[Assignment]) -> Result<Drives, String> {
    let format = LogFormat::of(path)?;
    Drives::read(&path.to_string_lossy(), || format.open(path), what_if)
}
