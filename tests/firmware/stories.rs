//! Some of the stories of `tests/stories/` on the release firmware: a converter that stalls and works again, a pack that is
//! learnt, kept in flash, and forgotten with the next, and percentages that act. `tests/host/stories.rs` has all of them in stepped
//! time.

use support::scenarios;
use support::story::{Story, play};
use workbench::bench::Bench;

#[test]
fn sensor_lost_while_driving() {
    play::<Bench>(&Story::named("sensor_lost_while_driving"));
}

#[test]
fn aged_pack_is_swapped() {
    play::<Bench>(&Story::named("aged_pack_is_swapped"));
}

#[test]
// Requirement: AP-18, PX-3
fn percent_that_acts() {
    play::<Bench>(&Story::named("percent_that_acts"));
}

#[test]
// Requirement: FR-16
fn parameters_are_kept() {
    scenarios::parameters_are_kept::<Bench>();
}
