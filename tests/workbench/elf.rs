//! Builds the ELFs that run on the emulated RP2040: release builds, as they are flashed.

use std::env;
use std::path::PathBuf;
use std::process::Command;

use support::repository;

const TARGET: &str = "thumbv6m-none-eabi";

/// What cargo builds an ELF from.
pub enum Artifact {
    Binary(&'static str),
    Example(&'static str),
}

/// Builds it and returns where it is.
///
/// Panics, saying what to type, if that fails. It is never skipped.
pub fn build(artifact: Artifact) -> PathBuf {
    add_target_if_missing();
    let (kind, name, folder) = match artifact {
        Artifact::Binary(name) => ("--bin", name, "release"),
        Artifact::Example(name) => ("--example", name, "release/examples"),
    };
    let target_dir = target_dir();
    let status = Command::new(env!("CARGO"))
        .current_dir(repository())
        // `.ci/run` sets it for the test harness alone; with it everything is another build.
        .env_remove("RUSTC_BOOTSTRAP")
        .args([
            "build",
            "--release",
            kind,
            name,
            "--target",
            TARGET,
            "--target-dir",
        ])
        .arg(&target_dir)
        .status()
        .expect("cargo can be started");
    assert!(
        status.success(),
        "{name} does not build for the board. If the target is missing, type: rustup target add {TARGET}"
    );
    target_dir.join(TARGET).join(folder).join(name)
}

/// The folder of the cargo that runs this, whose lock ends before the tests begin: what `cargo fw` has built is not built again.
fn target_dir() -> PathBuf {
    let program = env::current_exe().expect("the program's path is known");
    let folder = program.ancestors().nth(3);
    folder.expect("it is target/PROFILE/deps/PROGRAM").into()
}

/// With rustup's automatic installation off, the targets of rust-toolchain.toml are not added by themselves.
fn add_target_if_missing() {
    let Ok(installed) = rustup(&["target", "list", "--installed"]) else {
        // Not a rustup toolchain: if the target is missing, the build reports it.
        return;
    };
    if installed.lines().any(|target| target == TARGET) {
        return;
    }
    eprintln!("Adding the target {TARGET} to the Rust toolchain.");
    if let Err(error) = rustup(&["target", "add", TARGET]) {
        panic!(
            "The target {TARGET} is missing and could not be added ({error}). Type: rustup target add {TARGET}"
        );
    }
}

fn rustup(arguments: &[&str]) -> Result<String, String> {
    let output = Command::new("rustup")
        .current_dir(repository())
        .args(arguments)
        .output()
        .map_err(|error| error.to_string())?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}
