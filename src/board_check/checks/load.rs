//! Is the processor busy?

use super::check::{Check, Outcome, not_measured, outcome};
use crate::board_check::evidence::Evidence;

const WORST_PERMILLE: u16 = 100;

pub(super) const CHECK: Check = Check {
    name: "load",
    measures: "the highest `load` of SYS_STATUS while the board was left alone",
    expected: "at most 10 %: 0.7 to 4.7 % on the emulated chip (docs/performance.md), which counts no time for flash cache \
               misses",
    advice: "Attach the report: on silicon it was never measured.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    match evidence.sys_statuses().map(|status| status.load).max() {
        None => not_measured("no SYS_STATUS"),
        Some(0) => not_measured("the board reports none"),
        Some(permille) => outcome(
            format!("{:.1} %", f32::from(permille) / 10.0),
            (permille > WORST_PERMILLE).then_some("The processor is busier than it should be."),
        ),
    }
}
