//! The command line.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};

use clap::Parser;
use rover_battmon::pack::Pack;

use crate::assignments::Assignment;

const EXAMPLES: &str = "\
Examples:
  replay --param BATT_CELLS=3 --param BATT_LOW_VOLT=10.5 --plot drive.svg drive.csv
  replay --armed --param BATT_CELLS=3 --param BATT_LOW_VOLT=10.5 from-another-logger.csv
  replay --param BATT_LOW_VOLT=10.8 --csv rows.csv drive.BIN
  replay --table drives.parquet --history packs.html logs";

/// Runs a recorded drive through the battery monitor: what it reports, and when its failsafes act
#[derive(Parser)]
#[command(name = "replay", version, after_help = EXAMPLES)]
pub struct Arguments {
    /// Set a parameter, for example BATT_CELLS=3; may be given more than once
    #[arg(long = "param", value_name = "NAME=VALUE")]
    pub assignments: Vec<Assignment>,

    /// Take the rover for armed all along: failsafes act only then, and a recording may not have the column
    #[arg(long)]
    pub armed: bool,

    /// Replay this pack of a log, 1 to 9
    #[arg(long, value_name = "NUMBER", default_value = "1", value_parser = pack)]
    pub pack: Pack,

    /// Replay the vehicle with this MAVLink id of a ground station's log, not the one with most readings
    #[arg(long, value_name = "ID")]
    pub system: Option<u8>,

    /// Draw what the monitor made of the recording
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,

    /// Write a row for each reading, - to standard output; without this they go there unless that is a terminal
    #[arg(long, value_name = "FILE.csv")]
    pub csv: Option<PathBuf>,

    /// Print the curve of the pack's cells, as lines of a file of parameters: of a discharge over 5 h or more, from full to empty
    #[arg(long, conflicts_with_all = ["plot", "csv", "learned", "table", "history"])]
    pub curve: bool,

    /// What was learnt of the pack: read before the drive, if there is such a file, and written after it
    #[arg(long, value_name = "FILE")]
    pub learned: Option<PathBuf>,

    /// Print what the estimator assumes at this time of the recording: 90, 1:30 or 1:02:30
    #[arg(long, value_name = "TIME", value_parser = moment)]
    pub explain: Option<f64>,

    /// Write a row for each pack and drive of many logs
    #[arg(long, value_name = "FILE.parquet", conflicts_with_all = OF_ONE)]
    pub table: Option<PathBuf>,

    /// Write a page with the life of each pack in many logs
    #[arg(long, value_name = "FILE.html", conflicts_with_all = OF_ONE)]
    pub history: Option<PathBuf>,

    /// The recording, recognized by its content: a log of this board or ArduPilot (.BIN, .log), PX4 (.ulg) or a ground station (.tlog);
    /// or CSV with columns as t_s, voltage_v, current_a, healthy, armed. With --table and --history logs, and folders with all
    /// logs below
    #[arg(value_name = "RECORDING", required = true)]
    pub paths: Vec<PathBuf>,
}

impl Arguments {
    /// Whether rows go to standard output.
    pub fn prints_rows(&self) -> bool {
        let is_of_many = self.table.is_some() || self.history.is_some();
        let is_wanted = match &self.csv {
            Some(_) => self.csv_file().is_none(),
            None => !io::stdout().is_terminal(),
        };
        !is_of_many && is_wanted
    }

    /// The file for rows, if they go to one.
    pub fn csv_file(&self) -> Option<&Path> {
        self.csv.as_deref().filter(|path| *path != Path::new("-"))
    }
}

/// Options for one recording.
const OF_ONE: [&str; 7] = ["armed", "pack", "system", "plot", "csv", "learned", "explain"];

fn pack(number: &str) -> Result<Pack, String> {
    let found = Pack::ALL
        .into_iter()
        .find(|pack| pack.number().to_string() == number);
    found.ok_or_else(|| "1 to 9".into())
}

/// Seconds, minutes and seconds, or hours, minutes and seconds.
fn moment(text: &str) -> Result<f64, String> {
    let parts: Result<Vec<f64>, _> = text.split(':').map(str::parse).collect();
    let parts = parts.unwrap_or_default();
    let is_time = |part: &f64| part.is_finite() && *part >= 0.0;
    if !(1..=3).contains(&parts.len()) || !parts.iter().all(is_time) {
        return Err("90, 1:30 or 1:02:30".into());
    }
    Ok(parts.iter().fold(0.0, |time_s, part| 60.0 * time_s + part))
}
