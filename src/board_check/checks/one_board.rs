//! Is it alone on the link?

use super::check::{Check, Outcome, outcome};
use crate::board_check::evidence::Evidence;

pub(super) const CHECK: Check = Check {
    name: "one board",
    measures: "autopilots on the link, by their heartbeats",
    expected: "one: the answers of two mix",
    advice: "Take the other one off the link, or give it another network.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let others: Vec<_> = evidence.record.others.iter().map(|ids| name(*ids)).collect();
    let board = name(evidence.board.unwrap_or_default());
    if others.is_empty() {
        return outcome(board, None::<String>);
    }
    let others = others.join(", ");
    outcome(
        format!("{board}, {others}"),
        Some(format!("There is another autopilot: {others}.")),
    )
}

fn name((system_id, component_id): (u8, u8)) -> String {
    format!("system {system_id} component {component_id}")
}
