//! The files that a replay writes. They must destroy neither a recording nor anything that another program wrote.

use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

use rover_battmon::battery::{LearntPack, LearntTextError};

use crate::arguments::Arguments;
use crate::words::shown;
use crate::{history, plot, report, table};

/// Bytes of a file that show whether this program wrote it.
const HEAD_BYTES: u64 = 1 << 14;

/// Name of what the program prints to, on a system that has one.
const STANDARD_OUTPUT: &str = "/dev/stdout";

/// Links that are followed to a file that does not exist yet.
const MOST_LINKS: usize = 40;

/// Refuses outputs that are inputs or each other, and files that this program did not write.
///
/// # Errors
/// The first such output, in words.
pub fn check(arguments: &Arguments, inputs: &[PathBuf]) -> Result<(), String> {
    let inputs: Vec<Identity> = inputs
        .iter()
        .filter_map(|path| Identity::of(path).ok()?)
        .collect();
    let mut earlier: Vec<(Identity, &str)> = vec![];
    for output in Output::all(arguments) {
        let Output { argument, path, .. } = &output;
        let refused = |reason: &str| Err(format!("{argument} {}: {reason}", shown(path)));
        let identity = match Identity::of(path) {
            Ok(Some(identity)) => identity,
            Ok(None) => continue,
            // Not every system names it.
            Err(_) if output.is_own.is_none() => continue,
            Err(error) => return refused(&error.to_string()),
        };
        if inputs.contains(&identity) {
            return refused("is a recording to replay; name another file");
        }
        if let Some((_, other)) = earlier.iter().find(|(earlier, _)| *earlier == identity) {
            return refused(&format!("is also what {other} writes; name another file"));
        }
        match output.is_replaceable() {
            Ok(true) => earlier.push((identity, argument)),
            Ok(false) => return refused("was not written by this option; remove it, or name another file"),
            Err(error) => return refused(&error.to_string()),
        }
    }
    Ok(())
}

/// Whether a file that is there is an earlier output of the same kind.
type IsOwn = fn(File) -> bool;

/// A file to write.
struct Output {
    /// The argument that asks for it.
    argument: &'static str,
    path: PathBuf,
    /// `None` of what a shell has opened.
    is_own: Option<IsOwn>,
}

impl Output {
    fn all(arguments: &Arguments) -> Vec<Self> {
        let table = arguments.table.as_deref();
        let failures = table.and_then(table::failures_path);
        let printed = arguments.prints_rows().then(|| STANDARD_OUTPUT.into());
        let outputs: [(_, _, Option<IsOwn>); 7] = [
            (
                "--learned",
                arguments.learned.clone(),
                Some(|file| is_learned(&head(file))),
            ),
            (
                "--plot",
                arguments.plot.clone(),
                Some(|file| plot::is_plot(&head(file))),
            ),
            (
                "--csv",
                arguments.csv_file().map(Into::into),
                Some(|file| report::is_csv(&head(file))),
            ),
            ("--table", arguments.table.clone(), Some(table::is_table)),
            ("--table", failures, Some(|file| table::is_failures(&head(file)))),
            (
                "--history",
                arguments.history.clone(),
                Some(|file| history::is_page(&head(file))),
            ),
            ("standard output", printed, None),
        ];
        let outputs = outputs.into_iter().filter_map(|(argument, path, is_own)| {
            Some(Self {
                argument,
                path: path?,
                is_own,
            })
        });
        outputs.collect()
    }

    /// Whether nothing is lost with the file that is there, if there is one.
    fn is_replaceable(&self) -> io::Result<bool> {
        let Some(is_own) = self.is_own else {
            return Ok(true);
        };
        match File::open(&self.path) {
            Ok(file) => Ok(file.metadata()?.len() == 0 || is_own(file)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(true),
            Err(error) => Err(error),
        }
    }
}

/// The beginning of a file; empty if it can't be read.
fn head(file: File) -> String {
    let mut bytes = vec![];
    match file.take(HEAD_BYTES).read_to_end(&mut bytes) {
        Ok(_) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(_) => String::new(),
    }
}

/// Whether the first property is one of a pack. A mistake behind it is reported when the file is read.
fn is_learned(head: &str) -> bool {
    let mut lines = head.lines().map(str::trim);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with('#'));
    first.is_some_and(|line| !matches!(line.parse::<LearntPack>(), Err(LearntTextError::Line(_))))
}

/// A file, by whatever name.
#[derive(Debug, PartialEq, Eq)]
enum Identity {
    /// Device and inode of one that exists.
    #[cfg(unix)]
    Inode(u64, u64),
    Path(PathBuf),
}

impl Identity {
    /// That of a file that exists or would be created; `None` of pipes and devices.
    fn of(path: &Path) -> io::Result<Option<Self>> {
        match fs::metadata(path) {
            Ok(file) if file.is_dir() => Err(ErrorKind::IsADirectory.into()),
            Ok(file) if file.is_file() => Self::existing(path, &file).map(Some),
            Ok(_) => Ok(None),
            Err(error) if error.kind() == ErrorKind::NotFound => created(path).map(Self::Path).map(Some),
            Err(error) => Err(error),
        }
    }

    #[cfg(unix)]
    fn existing(_: &Path, file: &Metadata) -> io::Result<Self> {
        use std::os::unix::fs::MetadataExt;
        Ok(Self::Inode(file.dev(), file.ino()))
    }

    #[cfg(not(unix))]
    fn existing(path: &Path, _: &Metadata) -> io::Result<Self> {
        path.canonicalize().map(Self::Path)
    }
}

/// Path at which a file is created: links may lead to one that does not exist yet.
fn created(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&path) {
            Ok(link) => path = folder(&path).join(link),
            Err(_) => break,
        }
    }
    let name = path.file_name().ok_or(ErrorKind::InvalidFilename)?;
    Ok(folder(&path).canonicalize()?.join(name))
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
