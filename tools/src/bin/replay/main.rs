//! Runs a recorded drive through the battery monitor, as if it happened now.
//!
//! ```sh
//! cargo run --bin replay -- --param BATT_CELLS=3 --param BATT_CAPACITY=2200 --plot out.svg trace.csv > out.csv
//! ```
//!
//! A recording is read by [`rover_battmon_tools::recordings`]. What the monitor made of each reading goes to a file or to a
//! pipe, in the columns of [`report`]; what it comes to, in words, goes to standard error, see [`summary`]. With `--learned FILE`
//! the drives of one pack follow each other: what was learnt of it is read before the drive and written after it. `--curve` prints
//! the curve of its cells instead, see [`curve`].
//!
//! Many logs at once make a table of their drives, see [`table`], and a page with the life of each pack, see [`history`]; copies
//! of a log do not count, see [`copies`]. No file is replaced but an earlier output, see [`outputs`].
mod arguments;
mod assignments;
mod comparison;
mod copies;
mod curve;
mod drive;
mod failsafes;
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
mod vehicle;
mod words;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};

use arguments::Arguments;

/// Exit code of clap for arguments it does not understand, and here for a recording that can't be used.
const EXIT_USAGE: u8 = 2;

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
