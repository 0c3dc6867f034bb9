//! Does it announce trouble?

use super::check::{Check, Outcome, outcome};
use super::restarts::CRASH;
use crate::board_check::evidence::Evidence;
use crate::board_check::record::Text;
use crate::mavlink::dialect::MavSeverity;

/// These are judged by other checks.
const JUDGED_ELSEWHERE: [&str; 3] = [CRASH, "Arm:", "PreArm:"];

pub(super) const CHECK: Check = Check {
    name: "announcements",
    measures: "texts of severity CRITICAL or worse, except crashes and answers to an attempt to arm",
    expected: "none",
    advice: "Look the text up in docs/guides/troubleshooting.md.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let texts = evidence.record.texts();
    let is_severe = |text: &&Text| {
        let is_judged_elsewhere = JUDGED_ELSEWHERE.iter().any(|start| text.text.starts_with(start));
        text.severity as u32 <= MavSeverity::MAV_SEVERITY_CRITICAL as u32 && !is_judged_elsewhere
    };
    let mut severe = texts.iter().filter(is_severe);
    let against = severe
        .next()
        .map(|text| format!("The board announces: {}.", text.text));
    outcome(format!("{} texts", texts.len()), against)
}
