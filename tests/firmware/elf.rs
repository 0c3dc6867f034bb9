//! Builds the ELF under test: the release build, as it is flashed.

use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use crate::emulator::Firmware;

const TARGET: &str = "thumbv6m-none-eabi";

/// The release firmware, built once per run.
pub fn firmware() -> &'static Firmware {
    static FIRMWARE: OnceLock<Firmware> = OnceLock::new();
    FIRMWARE.get_or_init(|| {
        add_target_if_missing();
        Firmware::load(build())
    })
}

fn build() -> PathBuf {
    // Not the folder of the cargo that runs this test: that one is locked.
    let target_dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("firmware");
    let status = Command::new(env!("CARGO"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args([
            "build",
            "--release",
            "--bin",
            "rover-battmon",
            "--target",
            TARGET,
            "--target-dir",
        ])
        .arg(&target_dir)
        .status()
        .expect("cargo can be started");
    assert!(
        status.success(),
        "The firmware does not build: `cargo fw` shows why. If the target is missing, type: rustup target add {TARGET}"
    );
    target_dir.join(TARGET).join("release/rover-battmon")
}

/// With rustup's automatic installation off, the targets of rust-toolchain.toml are not added by themselves.
fn add_target_if_missing() {
    let Ok(installed) = rustup(&["target", "list", "--installed"]) else {
        // Not a rustup toolchain: the build itself will tell.
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
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(arguments)
        .output()
        .map_err(|error| error.to_string())?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}
