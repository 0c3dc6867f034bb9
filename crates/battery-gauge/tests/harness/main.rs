//! Judges estimators of a pack's charge by all drives at once: measured ones, which are not part of the repository, and simulated
//! ones. It prints the table of goals:
//!
//! `BATTERY_RECORDINGS=folder cargo test -p battery-gauge --profile harness --test harness -- --ignored --nocapture`
//!
//! Without the folder only the simulated ones are judged.

mod accuracy;
mod drive;
mod estimator;
mod goals;
mod owner;
mod recordings;
mod results;
mod runs;
#[path = "../battery_traces/sample.rs"]
mod sample;
mod score;
mod simulated;
mod table;

use estimator::{Estimator, Monitor};
use results::{Results, lives};

#[test]
#[ignore = "takes a minute, optimised"]
fn goals_of_all_drives() {
    let mut drives = recordings::drives();
    if drives.is_empty() {
        println!("Nothing was judged of recordings: BATTERY_RECORDINGS names no folder.");
    }
    drives.extend(simulated::drives());
    let lives = lives(&drives);
    let results = Results::of::<Monitor>(&drives, &lives);
    table::print(&[(Monitor::NAME, goals::rows(&results))]);
    goals::print_weeks(Monitor::NAME, &results);
}
