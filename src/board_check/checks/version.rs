//! Which firmware is it?

use super::check::{Check, Outcome, failed, not_measured, outcome};
use crate::board_check::evidence::Evidence;
use crate::identity::Identity;
use crate::mavlink::build_autopilot_version;

pub(super) const CHECK: Check = Check {
    name: "version",
    measures: "`flight_sw_version` in AUTOPILOT_VERSION",
    expected: concat!(env!("CARGO_PKG_VERSION"), ", as this program's"),
    advice: "Flash the release that this program belongs to.",
    judge,
};

pub(super) const HASH_CHECK: Check = Check {
    name: "firmware hash",
    measures: "`flight_custom_version` in AUTOPILOT_VERSION",
    expected: "what `--firmware-hash` says",
    advice: "Compare the flashed file with the release's hashes.",
    judge: judge_hash,
};

fn judge(evidence: &Evidence) -> Outcome {
    let Some(version) = &evidence.version else {
        return failed("no answer", "The board does not answer which version it runs.");
    };
    let [major, minor, patch, _] = version.flight_sw_version.to_be_bytes();
    let differs = version.flight_sw_version != build_autopilot_version(Identity::default()).flight_sw_version;
    outcome(
        format!("{major}.{minor}.{patch}"),
        differs.then_some("Board and program are of different versions."),
    )
}

fn judge_hash(evidence: &Evidence) -> Outcome {
    let Some(version) = &evidence.version else {
        return not_measured("no answer");
    };
    let hash = version.flight_custom_version;
    let shown: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
    match evidence.expected_hash {
        Some(expected) => outcome(
            shown,
            (hash != expected).then_some("The board runs another build."),
        ),
        None if hash == [0; 8] => not_measured("the firmware sends none"),
        None => not_measured(format!("{shown}, nothing to compare with")),
    }
}
