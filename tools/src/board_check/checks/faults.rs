//! Restarts, crashes, faults that the board announces, and its load.

use rover_battmon::mavlink::dialect::MavSeverity;
use rover_battmon::time::Instant;

use super::check::{Check, Outcome, failed, not_measured, outcome};
use crate::board_check::evidence::{Evidence, Text, Trial};

/// Beginning of a crash report.
pub(super) const CRASH: &str = "Crash:";

/// After five crashes in a row.
const QUICK_RESETS: &str = "5 quick resets";

/// Does it restart by itself?
pub(super) const RESTARTS: Check = Check {
    name: "restarts",
    measures: "starts by the board's time since boot, and the crashes it reports",
    expected: "none but those that were asked for: no watchdog, brown-out or crash",
    advice: "Attach the texts below: their addresses lead to the line with the ELF file of the release. Without a text it \
             was the power: check pack, plugs and USB cable.",
    judge: judge_restarts,
};

fn judge_restarts(evidence: &Evidence) -> Outcome {
    if evidence.record.round_trips.is_empty() {
        return not_measured("the board does not answer what its time is");
    }
    let starts = &evidence.record.starts;
    let unrequested = starts.iter().filter(|start| !start.is_requested).count();
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
        (unrequested > 0).then_some("The board restarted without being asked."),
    )
}

/// When a fault was provoked.
fn provoked_at(evidence: &Evidence) -> Option<Instant> {
    match &evidence.fault {
        Trial::Done(trial) => Some(trial.asked_at),
        Trial::NotAsked | Trial::NotReached => None,
    }
}

/// These are judged by other checks.
const JUDGED_ELSEWHERE: [&str; 3] = [CRASH, "Arm:", "PreArm:"];

/// Does it announce trouble?
pub(super) const ANNOUNCEMENTS: Check = Check {
    name: "announcements",
    measures: "texts of severity CRITICAL or worse, except crashes and answers to an attempt to arm",
    expected: "none",
    advice: "Look the text up in docs/troubleshooting.md.",
    judge: judge_announcements,
};

fn judge_announcements(evidence: &Evidence) -> Outcome {
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

/// Does the board receive and send without errors?
pub(super) const BOARD_ERRORS: Check = Check {
    name: "board's errors",
    measures: "`errors_comm` (damaged or overrun on its way in) and `errors_count3` (dropped for lack of room) of SYS_STATUS",
    expected: "no more of them while the board was left alone",
    advice: "With one more a second and nothing wired to GP1, it is noise; else check wires and baud rate.",
    judge: judge_board_errors,
};

fn judge_board_errors(evidence: &Evidence) -> Outcome {
    let mut statuses = evidence.sys_statuses();
    let Some(first) = statuses.next() else {
        return not_measured("no SYS_STATUS");
    };
    let last = statuses.last().unwrap_or(first);
    let received = last.errors_comm.saturating_sub(first.errors_comm);
    let dropped = last.errors_count3.saturating_sub(first.errors_count3);
    let measured = format!(
        "{} at first, {received} more; {dropped} messages dropped; loss {:.2} %",
        first.errors_comm,
        f32::from(last.drop_rate_comm) / 100.0
    );
    let against = if received > 0 {
        Some(format!("The board lost {received} of what it received."))
    } else {
        (dropped > 0)
            .then(|| format!("The board dropped {dropped} messages: the link is too slow for its rates."))
    };
    outcome(measured, against)
}

const WORST_PERMILLE: u16 = 100;

/// Is the processor busy?
pub(super) const LOAD: Check = Check {
    name: "load",
    measures: "the highest `load` of SYS_STATUS while the board was left alone",
    expected: "at most 10 %: 0.7 to 4.7 % on the emulated chip (docs/performance.md), which counts no time for flash cache \
               misses",
    advice: "Attach the report: on silicon it was never measured.",
    judge: judge_load,
};

fn judge_load(evidence: &Evidence) -> Outcome {
    match evidence.sys_statuses().map(|status| status.load).max() {
        None => not_measured("no SYS_STATUS"),
        Some(0) => not_measured("the board reports none"),
        Some(permille) => outcome(
            format!("{:.1} %", f32::from(permille) / 10.0),
            (permille > WORST_PERMILLE).then_some("The processor is busier than it should be."),
        ),
    }
}
