//! The table of drives, a row for each pack and drive: what its columns are is in [`columns`].

mod columns;
mod drives;
mod identity;
mod pack_drives;
mod parquet;
mod row;
mod statistics;

pub use drives::Drives;
pub use identity::Identity;
pub use parquet::is_table;
pub use row::{Estimate, Row};

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use crate::files::Failure;

/// First line of the failures.
const FAILURES_HEADER: &str = "path,reason";

/// Writes the table, and beside it what is not in it: that file is there without any failure, too, so that it is never that of
/// another run.
pub fn write(path: &Path, rows: &[Row], failures: &[Failure]) -> io::Result<()> {
    let failures_path = failures_path(path);
    parquet::write(rows, File::create(path)?).map_err(io::Error::other)?;
    failures_path.map_or(Ok(()), |path| fs::write(path, csv(failures)))
}

/// Place of the failures of a table; `None` beside a pipe or device.
pub fn failures_path(table: &Path) -> Option<PathBuf> {
    let is_file = table.is_file() || !table.exists();
    is_file.then(|| table.with_extension("failures.csv"))
}

/// Whether this is the beginning of such failures.
pub fn is_failures(head: &str) -> bool {
    head.lines().next() == Some(FAILURES_HEADER)
}

fn csv(failures: &[Failure]) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let lines = failures
        .iter()
        .map(|Failure { path, reason }| format!("{},{}\n", quoted(&path.to_string_lossy()), quoted(reason)));
    format!("{FAILURES_HEADER}\n{}", lines.collect::<String>())
}
