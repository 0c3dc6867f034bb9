//! What the firmware takes of flash and RAM.

use crate::figures::{Figure, Table};
use workbench::program::{FLASH_BUDGET_BYTES, RAM_BUDGET_BYTES, release_firmware};

pub fn tables() -> Vec<Table> {
    let firmware = release_firmware();
    let figure = |what: &str, bytes: u32, budget_bytes: u32| {
        Figure::new(what, f64::from(bytes)).with_goal(f64::from(budget_bytes))
    };
    let figures = vec![
        figure("flash", firmware.flash_bytes(), FLASH_BUDGET_BYTES),
        figure("static RAM", firmware.ram_bytes(), RAM_BUDGET_BYTES),
    ];
    let title = "the release firmware with everything in";
    vec![Table::new(title, "bytes", figures)]
}
