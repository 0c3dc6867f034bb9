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
//!
//! Many logs at once make a table of their drives, see [`table`], and a page with the life of each pack, see [`history`]; copies
//! of a log do not count, see [`copies`]. No file is replaced but an earlier output, see [`outputs`].
mod binlog;
mod comparison;
mod copies;
mod drive;
mod files;
mod history;
mod many;
mod outputs;
mod plot;
mod readings;
mod report;
mod run;
mod single;
mod summary;
mod survey;
mod table;
mod trace;
mod words;

use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use rover_battmon::pack::Pack;

use crate::run::Assignment;

/// What clap ends with for arguments it does not understand; a recording that can't be used is treated the same.
const EXIT_USAGE: u8 = 2;

const EXAMPLES: &str = "\
Examples:
  replay --param BATT_CELLS=3 --param BATT_LOW_VOLT=10.5 --plot drive.svg drive.csv
  replay --armed --param BATT_CELLS=3 --param BATT_LOW_VOLT=10.5 from-another-logger.csv
  replay --param BATT_LOW_VOLT=10.8 --csv rows.csv drive.BIN
  replay --table drives.parquet --history packs.html logs";

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

    /// Write a row for each pack and drive of many logs
    #[arg(long, value_name = "FILE.parquet", conflicts_with_all = OF_ONE)]
    table: Option<PathBuf>,

    /// Write a page with the life of each pack in many logs
    #[arg(long, value_name = "FILE.html", conflicts_with_all = OF_ONE)]
    history: Option<PathBuf>,

    /// The recording: CSV with columns as t_s, voltage_v, current_a, healthy, armed; or a log, drive.BIN. With --table and
    /// --history logs, and folders with all logs below
    #[arg(value_name = "RECORDING", required = true)]
    paths: Vec<PathBuf>,
}

impl Arguments {
    /// Whether rows go to standard output.
    fn prints_rows(&self) -> bool {
        let is_of_many = self.table.is_some() || self.history.is_some();
        !is_of_many && self.csv.is_none() && !io::stdout().is_terminal()
    }
}

/// What is of one recording.
const OF_ONE: [&str; 5] = ["armed", "pack", "plot", "csv", "learned"];

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
    if arguments.table.is_some() || arguments.history.is_some() {
        return many::replay(arguments);
    }
    let [path] = arguments.paths.as_slice() else {
        let text = "one recording at a time, or --table or --history";
        Arguments::command().error(ErrorKind::TooManyValues, text).exit();
    };
    single::replay(path, arguments)
}

#[cfg(target_os = "none")]
compile_error!("Drives are replayed on a host. For the board build `--bin rover-battmon`.");
