//! Does everything arrive?

use super::check::{Check, Outcome, outcome};
use crate::board_check::evidence::Evidence;

pub(super) const CHECK: Check = Check {
    name: "lost frames",
    measures: "gaps in the board's sequence numbers, except where damage explains them",
    expected: "none (the firmware numbers frames as they leave)",
    advice: "Use another cable or adapter; another program may read the same port.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let gaps = evidence.record.unexplained_gaps().filter(|gap| !gap.is_damage);
    let lost: usize = gaps.map(|gap| usize::from(gap.missing)).sum();
    let received = evidence.record.received.len();
    let against = (lost > 0).then(|| format!("{lost} frames were lost on the way."));
    outcome(format!("{lost} of {}", received + lost), against)
}
