//! The table of drives, a row for each pack and drive: what its columns are is in [`columns`].

mod columns;
mod drives;
mod pack_drives;
mod parquet;
mod row;
mod statistics;

pub use drives::rows;
pub use row::{Estimate, Row};

use std::fs::{self, File};
use std::io;
use std::path::Path;

use crate::files::Failure;

/// Writes the table, and beside it what is not in it: that file is there without any failure, too, so that it is never that of
/// another run.
pub fn write(path: &Path, rows: &[Row], failures: &[Failure]) -> io::Result<()> {
    parquet::write(rows, File::create(path)?).map_err(io::Error::other)?;
    fs::write(path.with_extension("failures.csv"), csv(failures))
}

fn csv(failures: &[Failure]) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let lines = failures
        .iter()
        .map(|Failure { path, reason }| format!("{},{}\n", quoted(&path.to_string_lossy()), quoted(reason)));
    format!("path,reason\n{}", lines.collect::<String>())
}
