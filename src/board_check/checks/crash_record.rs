//! Is a crash recorded?

use super::check::{Check, Outcome, failed, judge_trial, not_reached, outcome};
use super::restarts::CRASH;
use crate::board_check::evidence::{Evidence, FaultTrial};
use crate::board_check::session::Restarted;

/// The fault is provoked in the task that restarts the board.
const EXPECTED: &str = "Crash: hard fault in reboot";

pub(super) const CHECK: Check = Check {
    name: "crash record",
    measures: "the board's report of a fault that was provoked",
    expected: "a restart, and `Crash: hard fault in reboot, …` (docs/reliability.md)",
    advice: "Detach the debug probe: it catches the fault. Attach the report.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    judge_trial(&evidence.fault, "--provoke-fault", |trial| {
        judge_fault(trial, evidence)
    })
}

fn judge_fault(trial: &FaultTrial, evidence: &Evidence) -> Outcome {
    match trial.restarted {
        None => return not_reached(),
        Some(Restarted::After(_)) => {}
        Some(Restarted::Refused(result)) => {
            return failed(format!("{result:?}"), "The board refused to provoke a fault.");
        }
        Some(Restarted::Unanswered) => return failed("no answer", "The request was not acknowledged."),
        Some(Restarted::NotSeen) => return failed("no restart", "The board did not restart."),
    }
    let texts = evidence.record.texts();
    let mut crashes = texts
        .iter()
        .filter(|text| text.at >= trial.asked_at && text.text.starts_with(CRASH));
    match crashes.next() {
        Some(crash) => {
            let is_other = !crash.text.starts_with(EXPECTED);
            outcome(
                format!("`{}`", crash.text),
                is_other.then_some("Another crash was reported."),
            )
        }
        None => failed(
            "restarted, no report",
            "The board restarted and reported no crash.",
        ),
    }
}
