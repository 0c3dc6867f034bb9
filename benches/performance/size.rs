//! What the firmware takes of flash and RAM.

use crate::elf::{Artifact, build};
use crate::emulator::Firmware;
use crate::figures::{Figure, Table};

/// 160 KB and 64 KB.
const FLASH_GOAL_BYTES: f64 = 160_000.0;
const RAM_GOAL_BYTES: f64 = 65_536.0;

const IN_FLASH: [&str; 5] = [".boot2", ".vector_table", ".text", ".rodata", ".data"];
const IN_RAM: [&str; 3] = [".data", ".bss", ".uninit"];

pub fn tables() -> Vec<Table> {
    let firmware = Firmware::load(build(Artifact::Binary("rover-battmon")));
    let sum = |names: &[&str]| names.iter().map(|name| firmware.section(name).len() as f64).sum();
    vec![Table {
        title: "the release firmware with everything in",
        unit: "bytes",
        figures: vec![
            Figure::new("flash", sum(&IN_FLASH)).with_goal(FLASH_GOAL_BYTES),
            Figure::new("static RAM", sum(&IN_RAM)).with_goal(RAM_GOAL_BYTES),
        ],
    }]
}
