//! Which board is it?

use super::check::{Check, Outcome, not_measured, outcome};
use crate::board_check::evidence::Evidence;

pub(super) const CHECK: Check = Check {
    name: "serial number",
    measures: "`uid`, vendor and product in AUTOPILOT_VERSION",
    expected: "a number, if the firmware sends one",
    advice: "Nothing: it only names the board.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    match &evidence.version {
        None => not_measured("no answer"),
        Some(version) if version.uid == 0 => not_measured("the firmware sends none"),
        Some(version) => outcome(
            format!(
                "{:016x}, {:04x}:{:04x}",
                version.uid, version.vendor_id, version.product_id
            ),
            None::<String>,
        ),
    }
}
