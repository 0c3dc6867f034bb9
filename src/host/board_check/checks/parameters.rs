//! Whether parameters arrive and are kept.

use super::check::{Check, Outcome, failed, not_measured, not_reached, outcome};
use crate::host::board_check::evidence::{Evidence, KeptTrial};
use crate::host::board_check::session::Restarted;

/// Do all parameters arrive?
pub(super) const PARAMETER_LIST: Check = Check {
    name: "parameter list",
    measures: "parameters received, of those the board says it has",
    expected: "all",
    advice: "Run the check again by USB; with a signing key set, allow requests on this link.",
    judge: judge_parameter_list,
};

fn judge_parameter_list(evidence: &Evidence) -> Outcome {
    let Some(list) = &evidence.parameters else {
        return not_reached();
    };
    let Some(count) = list.count else {
        return failed("no answer", "The board sends no parameters.");
    };
    let received = list.by_index.len();
    let against = (received < usize::from(count)).then_some("Some parameters never arrived.");
    outcome(format!("{received} of {count}"), against)
}

/// Does a parameter survive a restart?
pub(super) const PARAMETER_KEPT: Check = Check {
    name: "parameter kept",
    measures: "`SR0_PARAMS` set, read after a restart, and set back",
    expected: "the value that was set (parameters are in flash before the board restarts)",
    advice: "See the board's texts and docs/guides/troubleshooting.md: a worn flash and a key that locks announce themselves.",
    judge: judge_parameter_kept,
};

fn judge_parameter_kept(evidence: &Evidence) -> Outcome {
    match &evidence.kept {
        Some(trial) => judge_trial(trial),
        None if evidence.parameters.is_some() => not_measured("the list had no SR0_PARAMS"),
        None => not_reached(),
    }
}

fn judge_trial(trial: &KeptTrial) -> Outcome {
    let measured = measured(trial);
    let KeptTrial { name, old, new, .. } = *trial;
    if trial.restored != Some(old) {
        let sentence = format!("That {name} was set back is not certain: it was {old}, and may be {new}.");
        return failed(measured, sentence);
    }
    let against = match trial.restarted {
        _ if trial.answered != Some(new) => Some(format!("{name} could not be set.")),
        Some(Restarted::After(_)) => (trial.read != Some(new)).then(|| format!("{name} was not kept.")),
        Some(Restarted::Refused(result)) => Some(format!("The restart was refused: {result:?}.")),
        Some(Restarted::Unanswered) => Some("The restart was not acknowledged.".into()),
        Some(Restarted::NotSeen) => Some("The board acknowledged the restart and did not restart.".into()),
        None => return not_reached(),
    };
    outcome(measured, against)
}

fn measured(trial: &KeptTrial) -> String {
    let after = match trial.restarted {
        Some(Restarted::After(us)) => format!(", restarted in {:.1} s", us as f32 / 1e6),
        _ => ", not restarted".into(),
    };
    let read = trial
        .read
        .map_or(", not read".into(), |read| format!(", read {read}"));
    format!("{} set to {}{after}{read}", trial.name, trial.new)
}
