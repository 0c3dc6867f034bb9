//! Which firmware is it?

use super::check::{Check, Outcome, failed, not_measured, outcome};
use crate::board_check::evidence::Evidence;
use crate::identity::{FirmwareHash, Identity};
use crate::mavlink::build_autopilot_version;

pub(super) const CHECK: Check = Check {
    name: "version",
    measures: "`flight_sw_version` in AUTOPILOT_VERSION",
    expected: concat!(env!("CARGO_PKG_VERSION"), ", as this program's"),
    advice: "Flash the release that this program belongs to.",
    judge,
};

/// What a simulator sends.
const NO_HASH: [u8; FirmwareHash::DIGITS] = [0; _];

pub(super) const HASH_CHECK: Check = Check {
    name: "firmware hash",
    measures: "`flight_custom_version` in AUTOPILOT_VERSION",
    expected: "the hash of the file given by `--firmware`",
    advice: "Flash the UF2 file that belongs to this ELF file.",
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
    let shown = match hash {
        NO_HASH => "none".into(),
        _ => String::from_utf8_lossy(&hash).into_owned(),
    };
    match evidence.expected_hash {
        Some(expected) => outcome(
            shown,
            (hash != expected.digits()).then_some("The board runs another build."),
        ),
        None => not_measured(format!("{shown}; not asked for: `--firmware`")),
    }
}
