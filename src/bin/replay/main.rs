//! Runs a recorded trace of a pack through the battery monitor, as if it happened now.
//!
//! ```sh
//! cargo run --bin replay -- --param BATT_CELLS=3 --param BATT_CAPACITY=2200 --plot out.svg trace.csv > out.csv
//! ```
//!
//! A trace is a CSV file with the columns `t_s`, `voltage_v`, `current_a`, `healthy` and `armed`, see [`trace`], or a log of
//! the board or of ArduPilot (`.BIN`), see [`drive`]. What the monitor made of each reading goes to standard output, in the
//! columns of [`report`]. With `--learned FILE` the drives of
//! one pack follow each other: what was learnt of it is read before the trace and written after it.
mod binlog;
mod drive;
mod plot;
mod report;
mod run;
mod settings;
mod trace;

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use rover_battmon::battery::{LearntPack, PackSettings};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;

use crate::binlog::Log;
use crate::drive::Drive;
use crate::plot::Caption;
use crate::report::Row;
use crate::settings::{Assignment, Inputs};
use crate::trace::Trace;

/// What clap ends with for arguments it does not understand; a trace that can't be used is no different.
const EXIT_USAGE: u8 = 2;

/// Replays a recorded trace of a battery through the monitor.
#[derive(Parser)]
#[command(name = "replay", about)]
struct Arguments {
    /// Set a parameter, for example BATT_CELLS=3; may be given more than once
    #[arg(long = "param", value_name = "NAME=VALUE")]
    assignments: Vec<Assignment>,

    /// Replay this pack of a log, 1 to 9
    #[arg(long, value_name = "NUMBER", default_value = "1", value_parser = pack)]
    pack: Pack,

    /// Draw what the monitor made of the trace
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,

    /// What was learnt of the pack: read before the trace, if there is such a file, and written after it
    #[arg(long, value_name = "FILE")]
    learned: Option<PathBuf>,

    /// The recording: t_s,voltage_v,current_a,healthy,armed; or a log, drive.BIN
    #[arg(value_name = "TRACE.csv")]
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
    let Drive { trace, parameters } = read(&arguments.trace, arguments.pack)?;
    let parameters = settings::assign(parameters, &arguments.assignments, arguments.pack, &trace)?;
    let inputs = Inputs::from_parameters(&parameters, arguments.pack)?;
    let mut learnt = match &arguments.learned {
        Some(path) => read_learnt(path)?,
        None => LearntPack::UNKNOWN,
    };
    let rows = run::run(&trace, arguments.pack, inputs, &parameters, &mut learnt);
    if let Some(path) = &arguments.learned {
        fs::write(path, learnt.to_string()).map_err(|error| about(path, &error))?;
    }
    if let Some(path) = &arguments.plot {
        fs::write(path, picture(arguments, &parameters, &rows)).map_err(|error| about(path, &error))?;
    }
    print(&rows).map_err(|error| format!("standard output: {error}"))
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
        parameters: Parameters::defaults(),
    })
}

fn read_log(path: &Path, pack: Pack) -> Result<Drive, String> {
    let bytes = fs::read(path).map_err(|error| about(path, &error))?;
    let log = Log::parse(&bytes);
    if log.skipped_bytes > 0 {
        let (skipped, all) = (log.skipped_bytes, bytes.len());
        eprintln!(
            "{}: skipped {skipped} of {all} bytes that are no whole records",
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
    let caption = Caption {
        title: &format!("{trace} through the battery monitor"),
        subtitle: &assignments.join("  "),
        failsafe: &PackSettings::from_parameters(parameters, arguments.pack).failsafe,
    };
    plot::plot(rows, &caption)
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
