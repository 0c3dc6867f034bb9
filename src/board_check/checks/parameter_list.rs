//! Do all parameters arrive?

use super::check::{Check, Outcome, failed, not_reached, outcome};
use crate::board_check::evidence::Evidence;

pub(super) const CHECK: Check = Check {
    name: "parameter list",
    measures: "parameters received, of those the board says it has",
    expected: "all",
    advice: "Run the check again by USB; with a signing key set, allow requests on this link.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let Some(list) = &evidence.parameters else {
        return not_reached();
    };
    let Some(count) = list.count else {
        return failed("no answer", "The board sends no parameters.");
    };
    let received = list.by_index.len();
    let against = (received < usize::from(count)).then_some("Some parameters never arrived.");
    outcome(format!("{received} of {count}"), against)
}
