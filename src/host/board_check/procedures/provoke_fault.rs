//! Provokes a fault and waits for its report.

use super::super::evidence::{Evidence, FaultTrial, Trial};
use super::super::session::{Interruption, Session};

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: ArduPilot's numbers for a provoked fault.
const PROVOKE_FAULT: [f32; 4] = [42.0, 24.0, 71.0, 94.0];

/// The board reports a crash to the first ground station it hears: after our next heartbeat, two seconds at 9600 baud.
const REPORT_US: u64 = 4_000_000;

/// Goes through it.
pub(in super::super) fn provoke_fault(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
) -> Result<(), Interruption> {
    let asked_at = session.now();
    let mut trial = FaultTrial {
        asked_at,
        restarted: None,
    };
    evidence.fault = Trial::Done(trial);
    trial.restarted = Some(session.restart(PROVOKE_FAULT)?);
    evidence.fault = Trial::Done(trial);
    session.listen_for(REPORT_US)
}
