//! Runs the selected runs, reports the progress, and sums up as `cargo test` does.

use std::panic::catch_unwind;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Instant;

use workbench::runs::budget::Budget;

/// A run that panics if something is wrong.
#[derive(Clone, Copy)]
pub struct Run {
    pub name: &'static str,
    run: fn(Budget),
}

impl Run {
    pub const fn new(name: &'static str, run: fn(Budget)) -> Self {
        Self { name, run }
    }

    fn passes(&self, budget: Budget) -> bool {
        println!("{} ...", self.name);
        let started = Instant::now();
        let passes = catch_unwind(|| (self.run)(budget)).is_ok();
        let outcome = if passes { "ok" } else { "FAILED" };
        println!(
            "{} ... {outcome} after {} s",
            self.name,
            started.elapsed().as_secs()
        );
        passes
    }
}

/// Runs as many at a time as there are processors. What the budget leaves no time for is listed, and counts as neither passed
/// nor failed.
pub fn run_all(runs: &[Run], budget: Budget) -> ExitCode {
    let started = Instant::now();
    let next = AtomicUsize::new(0);
    let (passed, skipped) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || {
        while let Some(run) = runs.get(next.fetch_add(1, Ordering::Relaxed)) {
            if budget.is_used_up() {
                println!("{} ... not begun: the time budget is used up", run.name);
                skipped.fetch_add(1, Ordering::Relaxed);
            } else {
                passed.fetch_add(usize::from(run.passes(budget.half())), Ordering::Relaxed);
            }
        }
    };
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    let (passed, skipped) = (passed.into_inner(), skipped.into_inner());
    let failed = runs.len() - passed - skipped;
    // A misspelt name is not a success.
    let is_ok = failed == 0 && passed > 0;
    let outcome = if is_ok { "ok" } else { "FAILED" };
    let seconds = started.elapsed().as_secs();
    println!("test result: {outcome}. {passed} passed; {failed} failed; finished in {seconds} s");
    if is_ok {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
