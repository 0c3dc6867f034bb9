//! Boards with seeded faults, and the tables of what has happened to them.

use std::fs;
use std::path::Path;

use workbench::bench::MINUTE;
use workbench::runs::budget::Budget;
use workbench::runs::soak::fault::Fault;
use workbench::runs::soak::tally::Tally;
use workbench::runs::soak::{Protection, run_board, run_boards};

/// Each board of the day runs for so long.
const BOARD_US: u64 = 30 * MINUTE;

/// Each other one.
const SHORT_US: u64 = 15 * MINUTE;

pub fn half_an_hour(budget: Budget) {
    let tally = run_boards(2, SHORT_US, budget, |sum| {
        publish(sum, "reliability-half-hour.md")
    });
    if budget.is_used_up() {
        return;
    }
    for fault in Fault::ALL {
        assert!(tally.times(fault) >= 4, "{fault:?}");
    }
}

/// Beside all that, strangers who have heard everything try to command the board.
pub fn a_quarter_of_an_hour_with_strangers(budget: Budget) {
    let tally = run_board(1, Protection::Key, SHORT_US, budget);
    publish(&tally, "reliability-key.md");
    assert!(tally.marks > 0, "the time of signatures was not written down");
}

pub fn sixty_minutes(budget: Budget) {
    run_boards(2, BOARD_US, budget, |sum| publish(sum, "reliability-sixty.md"));
}

pub fn a_day(budget: Budget) {
    run_boards(48, BOARD_US, budget, |sum| publish(sum, "reliability-day.md"));
}

/// Puts the table where `.ci/run` and `.ci/soak` find it.
fn publish(tally: &Tally, file: &str) {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
    fs::write(path, tally.to_string()).expect("the folder exists");
}
