//! Hours of the release firmware on emulated RP2040s. `cargo test` leaves them out, and runs a few minutes of each in
//! `tests/firmware` instead.
//!
//! `cargo test --test endurance` runs them, `cargo test --test endurance wrap` those with that word in their names.

#[path = "../workbench/bench.rs"]
#[allow(dead_code)]
mod bench;
#[path = "../workbench/downloads.rs"]
mod downloads;
#[path = "../support/elf.rs"]
mod elf;
#[path = "../workbench/i2c_bus.rs"]
mod i2c_bus;
#[path = "../workbench/log_records.rs"]
mod log_records;
#[path = "../support/motor_poles.rs"]
#[allow(dead_code)]
mod motor_poles;
#[path = "../workbench/runs/mod.rs"]
mod runs;
#[path = "../support/signer.rs"]
#[allow(dead_code)]
mod signer;
#[path = "../workbench/signing_key.rs"]
mod signing_key;
#[path = "../support/mod.rs"]
mod support;

mod logs;
mod runner;
mod seeded_faults;

use std::process::ExitCode;

use bench::{MINUTE, SECOND};
use emulator::FlashCut;
use runner::Run;
use runs::mixed_packs::{self, MIXED, MIXED_MV, TWO};
use runs::{exact_rates, line_noise, power_cuts, rates_asked_for, signing_time, time_wrap};

/// The longest first, so that no processor waits for the last one.
const RUNS: [Run; 14] = [
    Run::new("half an hour of seeded faults", seeded_faults::half_an_hour),
    Run::new(
        "a quarter of an hour of faults and strangers",
        seeded_faults::a_quarter_of_an_hour_with_strangers,
    ),
    Run::new("log power cuts", || logs::power_cuts(CUT_STEP)),
    Run::new("ten minutes of garbage", || line_noise::run(10 * MINUTE)),
    Run::new("ten minutes with four packs", || logs::drive(10 * MINUTE)),
    Run::new("power cuts before an operation", || {
        power_cuts::run(FlashCut::Before, 1..)
    }),
    Run::new("power cuts that leave a prefix", || {
        power_cuts::run(FlashCut::Prefix, 1..)
    }),
    Run::new("power cuts that leave scattered bits", || {
        power_cuts::run(FlashCut::ScatteredBits, 1..)
    }),
    Run::new("power cuts after an operation", || {
        power_cuts::run(FlashCut::After, 1..)
    }),
    Run::new("ten minutes across a wrap", || time_wrap::run(10 * MINUTE)),
    Run::new("ten minutes with a signing key", || {
        signing_time::run(10 * MINUTE)
    }),
    Run::new("a minute of two packs, and of nine", || {
        mixed_packs::run(&TWO, &MIXED_MV[..2], MINUTE);
        mixed_packs::run(&MIXED, &MIXED_MV, MINUTE);
    }),
    Run::new("rates asked for, 100 s each", || {
        rates_asked_for::by_interval(100 * SECOND);
        rates_asked_for::by_parameter(100 * SECOND);
    }),
    Run::new("ten minutes at exact rates", || exact_rates::run(10 * MINUTE)),
];

/// Of the operations of a rotation, every so many are cut.
const CUT_STEP: usize = 6;

/// They take long, so each only runs when it is asked for by this word.
const LONG_RUNS: [(&str, Run); 3] = [
    (
        "whole",
        Run::new("a whole hour with four packs", || logs::drive(60 * MINUTE)),
    ),
    (
        "every",
        Run::new("log power cuts in every operation", || logs::power_cuts(1)),
    ),
    ("day", Run::new("a day of seeded faults", seeded_faults::a_day)),
];

fn main() -> ExitCode {
    let words: Vec<_> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .collect();
    let mut runs = RUNS.to_vec();
    if !words.is_empty() {
        runs.retain(|run| words.iter().any(|word| run.name.contains(word)));
    }
    for (asked_as, run) in LONG_RUNS {
        if words.iter().any(|word| word == asked_as) {
            runs.push(run);
        }
    }
    runner::run_all(&runs)
}
