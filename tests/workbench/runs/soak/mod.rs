//! Boards that are driven, asked and set while one fault after the other comes, by chance that is the same in every run.

pub mod fault;
pub mod hostile;
mod inject;
mod ledger;
mod line;
mod motors;
mod packs;
mod receiver;
mod rig;
mod station;
pub mod tally;
mod watch;
mod wifi;

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use super::budget::Budget;
use super::progress::Progress;
use crate::bench::SECOND;
use fault::Fault;
pub use rig::Protection;
use rig::Rig;
use tally::Tally;

/// One board, for as long as asked for and the budget allows.
pub fn run_board(seed: u64, protection: Protection, length_us: u64, budget: Budget) -> Tally {
    let name = format!("seeded faults, board {seed}, protected by {protection:?}");
    println!("{name}");
    let mut rig = Rig::new(seed, protection);
    let from_us = rig.now_us();
    let mut progress = Progress::new(name, from_us);
    let before = rig.list();
    let mut due: Vec<Fault> = Vec::new();
    while rig.now_us() < from_us + length_us {
        if budget.is_used_up() {
            let seconds = (rig.now_us() - from_us) / SECOND;
            println!(
                "seeded faults, board {seed}: the time budget is used up after {seconds} emulated seconds"
            );
            break;
        }
        let pause_us = 2 * SECOND + rig.random.below(8_000_000) as u64;
        rig.run_for(pause_us);
        if due.is_empty() {
            due = Fault::ALL.to_vec();
        }
        // Each comes as often, in any order.
        let fault = due.swap_remove(rig.random.below(due.len()));
        rig.tally.injected(fault);
        rig.suffer(fault);
        progress.at(rig.now_us());
    }
    assert_eq!(rig.list(), before, "parameters that were not set");
    rig.read_log();
    rig.sum_up(from_us)
}

/// Runs boards of several seeds, as many at a time as there are processors, and publishes what has happened to all of them after
/// each.
pub fn run_boards(count: u64, length_us: u64, budget: Budget, publish: impl Fn(&Tally) + Sync) -> Tally {
    let next = AtomicU64::new(1);
    let sum = Mutex::new(Tally::default());
    let work = || loop {
        let seed = next.fetch_add(1, Ordering::Relaxed);
        if seed > count {
            return;
        }
        let tally = run_board(seed, Protection::None, length_us, budget);
        let mut sum = sum.lock().expect("no board has failed");
        sum.add(tally);
        publish(&sum);
    };
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    sum.into_inner().expect("no board has failed")
}
