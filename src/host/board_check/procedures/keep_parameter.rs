//! Sets a parameter, restarts the board, reads it, and sets the old value again.

use super::super::evidence::{Evidence, KeptTrial};
use super::super::session::{Interruption, Restarted, Session};
use super::parameters::{answer_of, post_set, read};

/// The rate of parameter lists: nothing else depends on it.
const NAME: &str = "SR0_PARAMS";

/// Where its range ends.
const MAX: f32 = 50.0;

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: restart the autopilot.
const RESTART: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

/// Goes through it, if the list had the parameter. Whatever ends it, the old value is set again.
pub(in super::super) fn keep_parameter(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
) -> Result<(), Interruption> {
    let Some(old) = evidence.parameter(NAME) else {
        return Ok(());
    };
    let trial = evidence.kept.insert(KeptTrial {
        name: NAME,
        old,
        new: if old < MAX { old + 1.0 } else { old - 1.0 },
        answered: None,
        restarted: None,
        read: None,
        restored: None,
    });
    let ended = set_and_restart(session, trial);
    post_set(session, NAME, old);
    ended?;
    trial.restored = answer_of(session, NAME)?;
    Ok(())
}

fn set_and_restart(session: &mut Session<'_>, trial: &mut KeptTrial) -> Result<(), Interruption> {
    post_set(session, NAME, trial.new);
    trial.answered = answer_of(session, NAME)?;
    let restarted = session.restart(RESTART)?;
    trial.restarted = Some(restarted);
    if matches!(restarted, Restarted::After(_)) {
        trial.read = read(session, NAME)?;
    }
    Ok(())
}
