#!/usr/bin/env python3
"""Builds a fresh crate that has `battery-gauge` as its only dependency, on chips without std.

It lies outside of this clone, so that nothing of the clone's configuration applies, and has the clone's toolchain and the
versions of its Cargo.lock. Each build begins from nothing. Printed are the crates that it compiles and its seconds; too many
crates are an error.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
GAUGE = REPOSITORY / "crates/battery-gauge"
TARGETS = ("thumbv7em-none-eabi", "thumbv6m-none-eabi")

# Crates that a build may compile at most, the gauge among them, by the features that are turned on.
MOST_CRATES = {(): 8, ("defmt",): 18}

MANIFEST = """\
[package]
name = "fresh"
version = "0.0.0"
edition = "2024"

[dependencies]
battery-gauge = {{ path = {path}, features = {features} }}
"""

SOURCE = """\
#![no_std]

use battery_gauge::{BatteryMonitor, BatteryState, Instant, LoadState, Measurement, PackSettings, Tick};

/// The charge of a 3S pack of 2200 mAh after a reading, in percent with its standard deviation.
pub fn charge(
    monitor: &mut BatteryMonitor,
    battery: &mut BatteryState,
    now_us: u64,
    voltage_v: f32,
    current_a: f32,
) -> Option<(f32, f32)> {
    let settings = PackSettings { cell_count: Some(3), capacity_mah: Some(2200.0), ..PackSettings::default() };
    let reading = Measurement { voltage_v: Some(voltage_v), current_a: Some(current_a), ..Measurement::default() };
    let tick = Tick { now: Instant::from_micros(now_us), load_state: LoadState::On };
    let _ = monitor.update(battery, tick, Ok(reading), &settings);
    battery.readings.remaining_pct.zip(battery.readings.remaining_sigma_pct)
}
"""


def create(crate, features):
    (crate / "src").mkdir(parents=True)
    manifest = MANIFEST.format(path=json.dumps(str(GAUGE)), features=json.dumps(features))
    (crate / "Cargo.toml").write_text(manifest, encoding="utf-8")
    (crate / "src/lib.rs").write_text(SOURCE, encoding="utf-8")
    for file in ("Cargo.lock", "rust-toolchain.toml"):
        shutil.copy(REPOSITORY / file, crate)


def build(crate, target):
    """The names of the crates that were compiled, without the fresh one's, and the seconds."""
    environment = {name: value for name, value in os.environ.items() if name not in ("CARGO_TARGET_DIR", "RUSTFLAGS")}
    run = {"cwd": crate, "env": environment, "check": True}
    subprocess.run(["rustup", "--quiet", "target", "add", target], **run)
    # The sources, which are no part of the time.
    subprocess.run(["cargo", "fetch", "--quiet", "--target", target], **run)
    start = time.monotonic()
    command = ["cargo", "build", "--release", "--quiet", "--target", target, "--message-format", "json-render-diagnostics"]
    built = subprocess.run(command, stdout=subprocess.PIPE, text=True, **run)
    seconds = time.monotonic() - start
    messages = map(json.loads, built.stdout.splitlines())
    folders = {pathlib.Path(message["manifest_path"]).parent for message in messages if message["reason"] == "compiler-artifact"}
    return sorted(folder.name for folder in folders - {crate}), seconds


def complaints(target, features):
    with tempfile.TemporaryDirectory() as folder:
        crate = pathlib.Path(folder).resolve() / "fresh"
        create(crate, features)
        crates, seconds = build(crate, target)
    what = f"{target}, {' '.join(features) or 'no feature'}"
    print(f"  {what}: {len(crates)} crates, {seconds:.1f} s")
    if len(crates) > MOST_CRATES[features]:
        yield f"{what}: more than {MOST_CRATES[features]} crates: {', '.join(crates)}"


def main():
    found = [complaint for features in MOST_CRATES for target in TARGETS for complaint in complaints(target, features)]
    for complaint in found:
        print(f"  {complaint}")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
