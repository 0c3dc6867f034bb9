//! Many logs at once, for a table of their drives or the life of each pack.
//!
//! All processors work, each on a log at a time. The rows are in the order of the logs' paths, however many processors there are.

use std::fs;
use std::path::Path;

use indicatif::ProgressBar;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use rover_battmon::battery::LearntPack;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;
use rover_battmon_tools::recordings::Format;

use crate::arguments::Arguments;
use crate::assignments::Assignment;
use crate::files::{Failure, Files};
use crate::run::{self, Replay};
use crate::survey::Inputs;
use crate::table::{self, Drives, Row};
use crate::words::{about, copies, shown};
use crate::{copies, history, outputs};

/// Results of many logs.
struct Found {
    rows: Vec<Row>,
    failures: Vec<Failure>,
    /// Lines about times that run backwards and clocks that were set.
    remarks: Vec<String>,
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
    for remark in &found.remarks {
        eprintln!("{remark}");
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
        remarks: vec![],
    };
    for (path, result) in logs.into_iter().zip(results) {
        match result {
            Ok(drives) => {
                found.rows.extend(drives.rows);
                let backward = (drives.backward_steps > 0).then(|| "times run backwards".into());
                let remarks = backward.into_iter().chain(drives.clock_text);
                found.remarks.extend(remarks.map(|text| about(&path, &text)));
            }
            Err(reason) => found.failures.push(Failure { path, reason }),
        }
    }
    found
}

fn read_log(path: &Path, what_if: &[Assignment]) -> Result<Drives, String> {
    let format = Format::of_log(path)?;
    Drives::read(&path.to_string_lossy(), || format.open(path), what_if)
}
