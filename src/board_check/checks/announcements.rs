//! Does it announce trouble?

use super::check::{Check, Outcome, outcome};
use super::restarts::CRASH;
use crate::board_check::evidence::Evidence;
use crate::mavlink::dialect::MavSeverity;

pub(super) const CHECK: Check = Check {
    name: "announcements",
    measures: "texts of severity CRITICAL or worse, crashes apart",
    expected: "none",
    advice: "Look the text up in docs/guides/troubleshooting.md.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let texts = evidence.record.texts();
    let is_severe = |severity: MavSeverity| severity as u32 <= MavSeverity::MAV_SEVERITY_CRITICAL as u32;
    let mut severe = texts
        .iter()
        .filter(|text| is_severe(text.severity) && !text.text.starts_with(CRASH));
    let against = severe
        .next()
        .map(|text| format!("The board announces: {}.", text.text));
    outcome(format!("{} texts", texts.len()), against)
}
