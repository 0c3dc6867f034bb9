//! What test programs share that needs no emulated board: ground stations, frames, the autopilot on a desk, stories.

pub mod charge_states;
pub mod checked;
pub mod commands;
pub mod desk;
pub mod frames;
pub mod fuzz;
pub mod learnt_record;
pub mod monitor_types;
pub mod motor_poles;
pub mod pack_report;
pub mod page;
pub mod parameter_flash;
pub mod requests;
pub mod scenarios;
pub mod signer;
pub mod story;
pub mod time;
pub mod vehicle;

use std::path::Path;

/// The root of the repository.
pub fn repository() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).expect("it is tests/support")
}

/// The version of the firmware, by its manifest.
pub fn firmware_version() -> &'static str {
    let mut lines = include_str!("../../Cargo.toml").lines();
    let version = lines.find_map(|line| line.strip_prefix("version = "));
    version.expect("the package has a version").trim_matches('"')
}
