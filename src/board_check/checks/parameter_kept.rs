//! Does a parameter survive a restart?

use super::check::{Check, Outcome, failed, not_measured, not_reached, outcome};
use crate::board_check::evidence::{Evidence, KeptTrial};
use crate::board_check::session::Restarted;

pub(super) const CHECK: Check = Check {
    name: "parameter kept",
    measures: "`SR0_PARAMS` set, read after a restart, and set back",
    expected: "the value that was set (parameters are in flash before the board restarts)",
    advice: "See the board's texts and docs/guides/troubleshooting.md: a worn flash and a key that locks announce themselves.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
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
