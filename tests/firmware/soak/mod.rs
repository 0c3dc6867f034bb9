//! Boards that are driven, asked and set while one fault after the other comes, by chance that is the same in every run.

mod docs;
mod fault;
pub mod hostile;
mod inject;
mod ledger;
mod line;
mod motors;
mod packs;
mod receiver;
mod rig;
mod station;
mod tally;
mod watch;
mod wear;

use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use crate::bench::SECOND;
use fault::Fault;
use rig::{Protection, Rig};
use tally::Tally;

/// Each board runs for so long.
const BOARD_US: u64 = 1_800 * SECOND;

/// Half an hour of one board.
fn run_board(seed: u64, protection: Protection) -> Tally {
    println!("board {seed}, protected by {protection:?}");
    let mut rig = Rig::new(seed, protection);
    let from_us = rig.now_us();
    let before = rig.list();
    let mut due: Vec<Fault> = Vec::new();
    while rig.now_us() < from_us + BOARD_US {
        let pause_us = 2 * SECOND + rig.random.below(8_000_000) as u64;
        rig.run_for(pause_us);
        if due.is_empty() {
            due = Fault::ALL.to_vec();
        }
        // Each comes as often, in any order.
        let fault = due.swap_remove(rig.random.below(due.len()));
        rig.tally.injected(fault);
        rig.suffer(fault);
    }
    assert_eq!(rig.list(), before, "parameters that nobody has set");
    rig.sum_up(from_us)
}

/// Runs boards of several seeds, as many at a time as there are processors, and publishes what has happened after each.
fn run_boards(count: u64, file: &str) -> Tally {
    let next = AtomicU64::new(1);
    let sum = Mutex::new(Tally::default());
    let work = || loop {
        let seed = next.fetch_add(1, Ordering::Relaxed);
        if seed > count {
            return;
        }
        let tally = run_board(seed, Protection::None);
        let mut sum = sum.lock().expect("no board has failed");
        sum.add(tally);
        publish(&sum, file);
    };
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    sum.into_inner().expect("no board has failed")
}

/// Puts the table where `.ci/run` and `.ci/soak` find it.
fn publish(tally: &Tally, file: &str) {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
    fs::write(path, tally.to_string()).expect("the folder exists");
}

#[test]
fn an_hour_of_faults_leaves_telemetry_motors_and_parameters_sound() {
    let tally = run_boards(2, "reliability-hour.md");
    println!("{tally}");
    for fault in Fault::ALL {
        assert!(tally.times(fault) >= 5, "{fault:?}");
    }
}

/// Beside all that, strangers who have heard everything try to command it.
#[test]
fn half_an_hour_of_faults_and_strangers_leaves_a_board_with_a_key_sound() {
    let tally = run_board(1, Protection::Key);
    publish(&tally, "reliability-key.md");
    println!("{tally}");
    assert!(tally.marks > 0, "the time of signatures was not written down");
}

#[test]
#[ignore = "an hour of our time; .ci/soak runs it"]
fn a_day_of_faults_leaves_telemetry_motors_and_parameters_sound() {
    let tally = run_boards(48, "reliability-day.md");
    println!("{tally}");
}
