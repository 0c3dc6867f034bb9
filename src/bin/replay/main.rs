//! Runs a recorded drive through the battery monitor, as if it happened now.
//!
//! ```sh
//! cargo run --bin replay -- --param BATT_CELLS=3 --param BATT_CAPACITY=2200 --plot out.svg trace.csv > out.csv
//! ```
//!
//! A recording is a CSV file with the columns `t_s`, `voltage_v`, `current_a`, `healthy` and `armed`, see [`trace`], or a log
//! of the board or of ArduPilot (`.BIN`), see [`drive`]. What the monitor made of each reading goes to a file or to a pipe, in
//! the columns of [`report`]; what it comes to, in words, goes to standard error, see [`summary`]. With `--learned FILE` the
//! drives of one pack follow each other: what was learnt of it is read before the drive and written after it.
mod binlog;
mod comparison;
mod drive;
mod plot;
mod report;
mod run;
mod summary;
mod trace;
mod words;

use std::fs;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use rover_battmon::battery::{LearntPack, PackSettings};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;

use crate::binlog::Log;
use crate::comparison::comparison;
use crate::drive::Drive;
use crate::report::Row;
use crate::run::{Assignment, Inputs};
use crate::summary::Summary;
use crate::trace::Trace;
use crate::words::utc;

/// What clap ends with for arguments it does not understand; a recording that can't be used is treated the same.
const EXIT_USAGE: u8 = 2;

const EXAMPLES: &str = "\
Examples:
  replay --param BATT_CELLS=3 --param BATT_LOW_VOLT=10.5 --plot drive.svg drive.csv
  replay --armed --param BATT_CELLS=3 --param BATT_LOW_VOLT=10.5 from-another-logger.csv
  replay --param BATT_LOW_VOLT=10.8 --csv rows.csv drive.BIN";

/// Runs a recorded drive through the battery monitor: what it reports, and when its failsafes act
#[derive(Parser)]
#[command(name = "replay", version, after_help = EXAMPLES)]
struct Arguments {
    /// Set a parameter, for example BATT_CELLS=3; may be given more than once
    #[arg(long = "param", value_name = "NAME=VALUE")]
    assignments: Vec<Assignment>,

    /// Take the rover for armed all along: failsafes act only then, and a recording may not have the column
    #[arg(long)]
    armed: bool,

    /// Replay this pack of a log, 1 to 9
    #[arg(long, value_name = "NUMBER", default_value = "1", value_parser = pack)]
    pack: Pack,

    /// Draw what the monitor made of the recording
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,

    /// Write a row for each reading; without this they go to standard output, unless that is a terminal
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,

    /// What was learnt of the pack: read before the drive, if there is such a file, and written after it
    #[arg(long, value_name = "FILE")]
    learned: Option<PathBuf>,

    /// The recording: CSV with columns as t_s, voltage_v, current_a, healthy, armed; or a log, drive.BIN
    #[arg(value_name = "RECORDING")]
    trace: PathBuf,
}

fn pack(number: &str) -> Result<Pack, String> {
    let found = Pack::ALL
        .into_iter()
        .find(|pack| pack.number().to_string() == number);
    found.ok_or_else(|| "1 to 9".into())
}

fn main() -> ExitCode {
    match replay(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(EXIT_USAGE)
        }
    }
}

fn replay(arguments: &Arguments) -> Result<(), String> {
    let pack = arguments.pack;
    let mut drive = read(&arguments.trace, pack)?;
    if arguments.armed {
        drive.trace.arm_throughout();
    }
    let own = drive.parameters.clone().unwrap_or_else(Parameters::defaults);
    let parameters = run::assign(own, &arguments.assignments, pack, &drive.trace)?;
    let inputs = Inputs::from_parameters(&parameters, pack)?;
    let known = match &arguments.learned {
        Some(path) => read_learnt(path)?,
        None => LearntPack::UNKNOWN,
    };
    let mut learnt = known;
    let rows = run::run(&drive.trace, pack, inputs, &parameters, &mut learnt);
    let written = write_files(arguments, &parameters, &rows, &learnt)?;
    let summary = Summary {
        trace: &drive.trace,
        rows: &rows,
        pack,
        settings: &PackSettings::from_parameters(&parameters, pack),
        known: &known,
        learnt: &learnt,
    };
    let compared = compared(arguments, &drive, &parameters, &rows, known)?;
    let date = drive.began_utc_s().map_or(String::new(), |utc_s| {
        format!("Recorded from {} on\n", utc(utc_s))
    });
    show(&format!("{date}{summary}{compared}{written}"));
    Ok(())
}

/// Writes what was asked for, and returns a line for each file.
fn write_files(
    arguments: &Arguments,
    parameters: &Parameters,
    rows: &[Row],
    learnt: &LearntPack,
) -> Result<String, String> {
    let files = [
        arguments.learned.as_ref().map(|path| (path, learnt.to_string())),
        arguments
            .plot
            .as_ref()
            .map(|path| (path, picture(arguments, parameters, rows))),
        arguments.csv.as_ref().map(|path| (path, report::csv(rows))),
    ];
    let mut written = String::new();
    for (path, text) in files.into_iter().flatten() {
        fs::write(path, text).map_err(|error| about(path, &error))?;
        written += &format!("wrote {}\n", path.display());
    }
    if arguments.csv.is_none() && !io::stdout().is_terminal() {
        print(rows).map_err(|error| format!("standard output: {error}"))?;
    }
    Ok(written)
}

/// What the arguments change of a log's own parameters, and what comes of that; empty if they change nothing.
fn compared(
    arguments: &Arguments,
    drive: &Drive,
    parameters: &Parameters,
    rows: &[Row],
    mut known: LearntPack,
) -> Result<String, String> {
    let Some(own) = drive.parameters.clone() else {
        return Ok(String::new());
    };
    let pack = arguments.pack;
    let own = run::assign(own, &[], pack, &drive.trace)?;
    let changes = run::changes(&own, parameters, &arguments.assignments);
    if changes.is_empty() {
        return Ok(String::new());
    }
    let inputs = Inputs::from_parameters(&own, pack)?;
    let own = run::run(&drive.trace, pack, inputs, &own, &mut known);
    Ok(comparison(&changes, &own, rows))
}

/// Shows what a person reads, who may have closed the terminal.
fn show(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// A log by the end of its name, else a trace.
fn read(path: &Path, pack: Pack) -> Result<Drive, String> {
    let is_log = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("bin"));
    if is_log {
        return read_log(path, pack);
    }
    let bytes = fs::read(path).map_err(|error| about(path, &error))?;
    Ok(Drive {
        trace: Trace::parse(&bytes).map_err(|error| about(path, &error))?,
        parameters: None,
        started_utc_s: None,
    })
}

fn read_log(path: &Path, pack: Pack) -> Result<Drive, String> {
    let bytes = fs::read(path).map_err(|error| about(path, &error))?;
    let log = Log::parse(&bytes);
    if log.skipped_bytes > 0 {
        let (skipped, all) = (log.skipped_bytes, bytes.len());
        eprintln!(
            "{}: skipped {skipped} of {all} bytes that are not whole records",
            path.display()
        );
    }
    Drive::of_pack(&log, pack).map_err(|error| about(path, &error))
}

fn about(path: &Path, error: &dyn std::fmt::Display) -> String {
    format!("{}: {error}", path.display())
}

/// What was learnt in earlier drives; nothing before the first.
fn read_learnt(path: &Path) -> Result<LearntPack, String> {
    match fs::read_to_string(path) {
        Ok(text) => text.parse().map_err(|error| about(path, &error)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(LearntPack::UNKNOWN),
        Err(error) => Err(about(path, &error)),
    }
}

/// The rows as a picture that says what it shows.
fn picture(arguments: &Arguments, parameters: &Parameters, rows: &[Row]) -> String {
    let trace = arguments.trace.file_name().unwrap_or_default().to_string_lossy();
    let assignments: Vec<String> = arguments.assignments.iter().map(ToString::to_string).collect();
    let title = format!("{trace} through the battery monitor");
    let settings = PackSettings::from_parameters(parameters, arguments.pack);
    plot::plot(rows, &title, &assignments.join("  "), &settings.failsafe)
}

fn print(rows: &[Row]) -> io::Result<()> {
    match io::stdout().write_all(report::csv(rows).as_bytes()) {
        // The reader of the rows has closed the pipe.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

#[cfg(target_os = "none")]
compile_error!("Drives are replayed on a host. For the board build `--bin rover-battmon`.");
