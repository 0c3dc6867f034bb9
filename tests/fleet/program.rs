//! `replay` as a process, with the time and the memory that it takes.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// How often the memory of the process is looked at.
const LOOK: Duration = Duration::from_millis(2);

/// A process that has ended.
pub struct Run {
    pub output: Output,
    pub seconds: f64,
    /// The most memory it had when it was looked at, in bytes.
    pub peak_bytes: u64,
}

impl Run {
    pub fn errors(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    pub fn figures(&self, cores: u32) -> String {
        let megabytes = self.peak_bytes as f64 / 1e6;
        format!("{cores} cores: {:.2} s, {megabytes:.1} MB", self.seconds)
    }
}

/// `replay ARGUMENTS` on this many cores.
pub fn replay(arguments: &[impl AsRef<OsStr>], cores: u32) -> Run {
    let start = Instant::now();
    let child = Command::new(env!("CARGO_BIN_EXE_replay"))
        .args(arguments)
        .env("RAYON_NUM_THREADS", cores.to_string())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it is built");
    let id = child.id();
    let ended = thread::spawn(move || child.wait_with_output().expect("it ends"));
    let mut peak_bytes = 0;
    while !ended.is_finished() {
        peak_bytes = peak_bytes.max(memory_bytes(id).unwrap_or(0));
        thread::sleep(LOOK);
    }
    Run {
        output: ended.join().expect("it ends"),
        seconds: start.elapsed().as_secs_f64(),
        peak_bytes,
    }
}

/// The most memory that a process had, as Linux has it.
fn memory_bytes(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kib * 1024)
}

/// `replay --table` of these paths, which succeeds, and where the table is: one of an earlier test run may be of another
/// version.
pub fn table(paths: &[&str], name: &str, cores: u32) -> (Run, PathBuf) {
    let path = temporary().join(format!("{name}.parquet"));
    let _ = fs::remove_file(&path);
    let arguments = ["--table", path.to_str().expect("a path")];
    let run = replay(&[&arguments[..], paths].concat(), cores);
    assert!(run.output.status.success(), "{}", run.errors());
    (run, path)
}

/// A folder of this test run, which is empty.
pub fn folder(name: &str) -> PathBuf {
    let path = temporary().join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).expect("a folder");
    path
}

fn temporary() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}
