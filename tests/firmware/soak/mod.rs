//! A few minutes of the runs with seeded faults, the table of the whole day, and the wear of the flash.

mod docs;
mod wear;

use crate::bench::MINUTE;
use crate::runs::budget::Budget;
use crate::runs::soak::fault::Fault;
use crate::runs::soak::{Protection, run_board, run_boards};

/// Long enough for every fault to come once.
const LENGTH_US: u64 = 6 * MINUTE;

#[test]
fn every_fault_leaves_telemetry_motors_and_parameters_sound() {
    let tally = run_boards(1, LENGTH_US, Budget::UNLIMITED, |_| ());
    println!("{tally}");
    for fault in Fault::ALL {
        assert!(tally.times(fault) >= 1, "{fault:?}");
    }
}

/// Beside all that, strangers who have heard everything try to command it.
#[test]
fn faults_and_strangers_leave_a_board_with_a_key_sound() {
    let tally = run_board(1, Protection::Key, 2 * MINUTE, Budget::UNLIMITED);
    println!("{tally}");
    assert!(tally.marks > 0, "the time of signatures was not written down");
}
