//! Hours of the release firmware on emulated RP2040s. `cargo test` leaves them out, and runs a few minutes of each in
//! `tests/firmware` instead.
//!
//! `cargo test --test endurance` runs them, `cargo test --test endurance wrap` those with that word in their names,
//! `cargo test --test endurance -- --budget 300` as much of them as goes into that many seconds.

mod logs;
mod runner;
mod seeded_faults;

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;

use emulator::FlashCut;
use runner::Run;
use workbench::bench::{MINUTE, SECOND};
use workbench::runs::budget::Budget;
use workbench::runs::mixed_packs::{self, MIXED, MIXED_MV};
use workbench::runs::{
    exact_rates, line_noise, power_cuts, radio_restarts, rates_asked_for, signing_time, time_wrap,
};

/// The longest first, so that no processor waits for the last one.
const RUNS: [Run; 14] = [
    Run::new("half an hour of seeded faults", seeded_faults::half_an_hour),
    Run::new(
        "a quarter of an hour of faults and strangers",
        seeded_faults::a_quarter_of_an_hour_with_strangers,
    ),
    Run::new("log power cuts", |budget| logs::power_cuts(CUT_STEP, budget)),
    Run::new("ten minutes of garbage", |_| line_noise::run(10 * MINUTE)),
    Run::new("ten minutes with four packs", |_| logs::drive(10 * MINUTE)),
    Run::new("power cuts before an operation", |budget| {
        power_cuts::run(FlashCut::Before, budget.limit(1.., "power cuts"))
    }),
    Run::new("power cuts that leave a prefix", |budget| {
        power_cuts::run(FlashCut::Prefix, budget.limit(1.., "power cuts"))
    }),
    Run::new("power cuts that leave scattered bits", |budget| {
        power_cuts::run(FlashCut::ScatteredBits, budget.limit(1.., "power cuts"))
    }),
    Run::new("power cuts after an operation", |budget| {
        power_cuts::run(FlashCut::After, budget.limit(1.., "power cuts"))
    }),
    Run::new("ten minutes across a wrap", |_| time_wrap::run(10 * MINUTE)),
    Run::new("ten minutes with a signing key", |_| {
        signing_time::run(10 * MINUTE)
    }),
    Run::new("a minute of two packs, and of nine", |_| {
        mixed_packs::run(&TWO, &MIXED_MV[..2], MINUTE);
        mixed_packs::run(&MIXED, &MIXED_MV, MINUTE);
    }),
    Run::new("rates asked for, 100 s each", |_| {
        rates_asked_for::by_interval(100 * SECOND);
        rates_asked_for::by_parameter(100 * SECOND);
    }),
    Run::new("ten minutes at exact rates", |_| exact_rates::run(10 * MINUTE)),
];

/// The first two of all kinds of packs.
const TWO: [(&str, f32); 1] = [("BATT2_MONITOR", 21.0)];

/// Of the operations of a rotation, every this many are cut.
const CUT_STEP: usize = 6;

/// They take long, so each only runs when it is asked for by this word.
const LONG_RUNS: [(&str, Run); 5] = [
    (
        "thousand",
        Run::new("a thousand restarts of the radio", |_| {
            radio_restarts::run(1_000, 2)
        }),
    ),
    (
        "whole",
        Run::new("a whole hour with four packs", |_| logs::drive(60 * MINUTE)),
    ),
    (
        "every",
        Run::new("log power cuts in every operation", |budget| {
            logs::power_cuts(1, budget)
        }),
    ),
    (
        "sixty",
        Run::new("sixty minutes of seeded faults", seeded_faults::sixty_minutes),
    ),
    ("day", Run::new("a day of seeded faults", seeded_faults::a_day)),
];

/// Runs the firmware on emulated boards for hours.
#[derive(Parser)]
#[command(bin_name = "cargo test --test endurance --")]
struct Arguments {
    /// Runs with one of these words in their names; all if none is given
    words: Vec<String>,

    /// Seconds after which no run begins; each takes at most half of what is left when it begins, and does less if need be
    #[arg(long, value_name = "SECONDS")]
    budget: Option<u64>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let is_named = |run: &Run| arguments.words.iter().any(|word| run.name.contains(word));
    let mut runs = RUNS.to_vec();
    if !arguments.words.is_empty() {
        runs.retain(is_named);
    }
    for (asked_as, run) in LONG_RUNS {
        if arguments.words.iter().any(|word| word == asked_as) {
            runs.push(run);
        }
    }
    let budget = arguments.budget.map(Duration::from_secs);
    runner::run_all(&runs, budget.map_or(Budget::UNLIMITED, Budget::of))
}
