//! Does it restart by itself?

use super::check::{Check, Outcome, failed, not_measured, outcome};
use crate::board_check::evidence::{Evidence, Trial};
use crate::board_check::record::StartCause;
use crate::time::Instant;

/// What a crash report begins with.
pub(super) const CRASH: &str = "Crash:";

/// After five crashes in a row.
const QUICK_RESETS: &str = "5 quick resets";

pub(super) const CHECK: Check = Check {
    name: "restarts",
    measures: "starts by the board's time since boot, and the crashes it reports",
    expected: "none but those that were asked for: no watchdog, brown-out or crash",
    advice: "Attach the texts below: their addresses lead to the line with the ELF file of the release. Without a text it \
             was the power: check pack, plugs and USB cable.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    if evidence.record.round_trips.is_empty() {
        return not_measured("the board does not answer what its time is");
    }
    let starts = &evidence.record.starts;
    let unrequested = starts
        .iter()
        .filter(|start| start.cause == StartCause::Unrequested)
        .count();
    let measured = format!("{} asked for, {unrequested} others", starts.len() - unrequested);
    let provoked_at = provoked_at(evidence);
    let texts = evidence.record.texts();
    let mut crashes = texts.iter().filter(|text| {
        let is_provoked = provoked_at.is_some_and(|provoked_at| text.at >= provoked_at);
        text.text.starts_with(QUICK_RESETS) || text.text.starts_with(CRASH) && !is_provoked
    });
    if let Some(crash) = crashes.next() {
        return failed(measured, format!("The board reports: {}.", crash.text));
    }
    outcome(
        measured,
        (unrequested > 0).then_some("The board started anew without being asked."),
    )
}

/// When a fault was provoked.
fn provoked_at(evidence: &Evidence) -> Option<Instant> {
    match &evidence.fault {
        Trial::Done(trial) => Some(trial.asked_at),
        Trial::NotAsked | Trial::NotReached => None,
    }
}
