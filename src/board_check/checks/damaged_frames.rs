//! Does everything arrive whole?

use super::check::{Check, Outcome, outcome};
use crate::board_check::evidence::Evidence;

pub(super) const CHECK: Check = Check {
    name: "damaged frames",
    measures: "places with bytes that are no part of a frame with a good checksum",
    expected: "none",
    advice: "Check ground and length of the wires and the baud rate; keep them away from the motors'.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let damaged = evidence
        .record
        .unexplained_gaps()
        .filter(|gap| gap.is_damage)
        .count();
    let against = (damaged > 0).then(|| format!("What the board sent was damaged in {damaged} places."));
    outcome(damaged.to_string(), against)
}
