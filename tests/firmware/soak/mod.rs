//! A minute or two of the runs with seeded faults, which are whole in `tests/endurance`; the table of the whole day, and the wear
//! of the flash.

mod docs;
mod wear;

use workbench::bench::SECOND;
use workbench::runs::budget::Budget;
use workbench::runs::soak::fault::Fault;
use workbench::runs::soak::{Protection, run_board};

/// Beside all that, strangers who have heard everything try to command it.
#[test]
fn faults_and_strangers_leave_telemetry_motors_and_parameters_sound() {
    let tally = run_board(1, Protection::Key, 90 * SECOND, Budget::UNLIMITED);
    println!("{tally}");
    assert!(tally.marks > 0, "the time of signatures was not written down");
    let kinds = Fault::ALL.into_iter().filter(|fault| tally.times(*fault) > 0);
    assert!(kinds.count() >= 5);
}
