//! Which logs are to be read: files, and folders with all below.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rover_battmon_tools::recordings::Format;

/// Why a path gives no row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The path, as it was found.
    pub path: PathBuf,
    /// Why.
    pub reason: String,
}

/// The files that were found.
#[derive(Debug, Default)]
pub struct Files {
    /// Logs, each once, in the order of their paths.
    pub logs: Vec<PathBuf>,
    /// Paths that can't be read.
    pub failures: Vec<Failure>,
    /// What was seen: links may lead to the same file or folder more than once, or in a circle.
    seen: HashSet<PathBuf>,
}

impl Files {
    /// All logs that these paths lead to.
    pub fn find(paths: &[PathBuf]) -> Self {
        let mut files = Self::default();
        for path in paths {
            let before = files.logs.len();
            files.take(path);
            if path.is_dir() && files.logs.len() == before {
                files.fail(path, "no log in this folder (.BIN, .log, .tlog, .ulg)");
            }
        }
        files.logs.sort();
        files
    }

    fn take(&mut self, path: &Path) {
        if let Err(error) = self.try_take(path) {
            self.fail(path, &error.to_string());
        }
    }

    fn try_take(&mut self, path: &Path) -> io::Result<()> {
        if !self.seen.insert(path.canonicalize()?) {
            return Ok(());
        }
        if path.is_dir() {
            return self.take_folder(path);
        }
        self.logs.push(path.into());
        Ok(())
    }

    /// In the order of names, so that of several links to a file it is always the same one that counts.
    fn take_folder(&mut self, folder: &Path) -> io::Result<()> {
        let entries: io::Result<Vec<PathBuf>> = fs::read_dir(folder)?
            .map(|entry| entry.map(|entry| entry.path()))
            .collect();
        let mut entries = entries?;
        entries.sort();
        for entry in entries.iter().filter(|entry| entry.is_dir() || is_log(entry)) {
            self.take(entry);
        }
        Ok(())
    }

    fn fail(&mut self, path: &Path, reason: &str) {
        self.failures.push(Failure {
            path: path.into(),
            reason: reason.into(),
        });
    }
}

/// Whether a file in a folder is a log by the end of its name. Many other programs write texts that end with `.log`: these
/// are no logs by their content.
fn is_log(path: &Path) -> bool {
    let ending = path.extension().map(OsStr::to_ascii_lowercase);
    match ending.as_ref().and_then(|ending| ending.to_str()) {
        Some("bin" | "tlog" | "ulg") => true,
        Some("log") => Format::of_log(path).is_ok(),
        _ => false,
    }
}
