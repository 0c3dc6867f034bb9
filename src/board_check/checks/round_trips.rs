//! Does it answer quickly?

use super::check::{Check, Outcome, failed, not_reached, outcome};
use crate::board_check::evidence::Evidence;

const MEDIAN_US: u64 = 50_000;
const WORST_US: u64 = 250_000;

pub(super) const CHECK: Check = Check {
    name: "round trips",
    measures: "TIMESYNC, twice a second, until its answer",
    expected: "all answered; median at most 50 ms, worst at most 250 ms (a cable's, at 57600 baud behind a full burst)",
    advice: "Connect by cable: a radio takes longer. By cable, look for load and lost frames.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let Some(window) = evidence.window else {
        return not_reached();
    };
    let record = &evidence.record;
    let is_judged = |at| window.contains(at) && !record.is_broken_by_start(at);
    let trips = record.round_trips.iter().filter(|trip| is_judged(trip.asked_at));
    let took: Vec<_> = trips.map(|trip| trip.took_us).collect();
    let mut answered_us: Vec<_> = took.iter().flatten().copied().collect();
    answered_us.sort_unstable();
    let (Some(median_us), Some(worst_us)) = (answered_us.get(answered_us.len() / 2), answered_us.last())
    else {
        return failed("no answer", "The board answers no TIMESYNC.");
    };
    let unanswered = took.len() - answered_us.len();
    let measured = format!(
        "median {:.0} ms, worst {:.0} ms, {unanswered} of {} unanswered",
        *median_us as f64 / 1e3,
        *worst_us as f64 / 1e3,
        took.len()
    );
    let against = if *median_us > MEDIAN_US || *worst_us > WORST_US {
        Some("The board answers slowly.")
    } else {
        // A frame that was lost or damaged is counted as such.
        (unanswered > record.gaps.len()).then_some("The board leaves requests unanswered.")
    };
    outcome(measured, against)
}
