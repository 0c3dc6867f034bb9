//! Procedures with the board. Each leaves evidence, and judges nothing.

mod parameters;
mod turn_motors;

use ::mavlink::MessageData;

use super::evidence::{
    Calibration, Evidence, FaultTrial, Interruption, KeptTrial, Restarted, Trial, first_pack_v, mean,
};
use super::plan::{Multimeter, Plan};
use super::session::Session;
use parameters::{answer_of, post_set, read, set};
use rover_battmon::mavlink::dialect::{AUTOPILOT_VERSION_DATA, MavCmd, MavMessage, MavModeFlag};
use rover_battmon::parameter::{ParameterId, VehicleParameter};

pub(super) use parameters::download;
pub(super) use turn_motors::turn_motors;

/// Five heartbeats; a board that was just plugged in needs a second to start.
const HEARTBEAT_TIMEOUT_US: u64 = 5_000_000;

const VERSION_TIMEOUT_US: u64 = 1_000_000;
const ATTEMPTS: usize = 3;

/// Waits for an autopilot's heartbeat. It says whether the rover is armed.
pub(super) fn connect(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    let began = session.now();
    let mode = session.wait_for(HEARTBEAT_TIMEOUT_US, |message| match message {
        MavMessage::HEARTBEAT(heartbeat) => Some(heartbeat.base_mode),
        _ => None,
    })?;
    evidence.board = session.board();
    evidence.connected_after_us = session.now().us_since(began);
    match mode {
        Some(mode) if mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED) => Err(Interruption::Armed),
        _ => Ok(()),
    }
}

/// Asks for AUTOPILOT_VERSION.
pub(super) fn identify(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    for _ in 0..ATTEMPTS {
        let request = [AUTOPILOT_VERSION_DATA::ID as f32, 0.0, 0.0, 0.0];
        session.post_command(MavCmd::MAV_CMD_REQUEST_MESSAGE, request);
        evidence.version = session.wait_for(VERSION_TIMEOUT_US, |message| match message {
            MavMessage::AUTOPILOT_VERSION(version) => Some(version.clone()),
            _ => None,
        })?;
        if evidence.version.is_some() {
            break;
        }
    }
    Ok(())
}

/// Forty messages of each stream at its default rate.
const LISTENING_US: u64 = 20_000_000;

/// Listens to telemetry.
pub(super) fn listen(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    let from = session.now();
    session.listen_for(LISTENING_US)?;
    evidence.window = Some(from..=session.now());
    Ok(())
}

const MULTIPLIER: &str = "BATT_VOLT_MULT";

/// A new multiplier is in the next reading; some readings are averaged.
const SETTLING_US: u64 = 1_000_000;
const AVERAGING_US: u64 = 3_000_000;

/// Compares the shown voltage with a multimeter's.
pub(super) fn calibrate(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
    plan: &Plan,
) -> Result<(), Interruption> {
    let measured_v = match plan.multimeter {
        Multimeter::None => return Ok(()),
        Multimeter::Shows(measured_v) => Some(measured_v),
        Multimeter::Ask => ask_voltage(session)?,
    };
    let mut calibration = Calibration {
        measured_v,
        shown_v: shown_v(session)?,
        old: evidence.parameter(MULTIPLIER),
        pin: evidence.parameter("BATT_VOLT_PIN"),
        divider: plan.divider,
        ..Calibration::default()
    };
    if let Some(exact) = calibration.believed().filter(|_| plan.apply_calibration) {
        calibration.applied = set(session, MULTIPLIER, exact)?;
        session.listen_for(SETTLING_US)?;
        calibration.shown_since_v = shown_v(session)?;
    }
    evidence.calibration = Trial::Done(calibration);
    Ok(())
}

fn ask_voltage(session: &mut Session<'_>) -> Result<Option<f32>, Interruption> {
    loop {
        let answer = session.ask("What does the multimeter show at the pack, in volts? (return to skip)")?;
        let Some(line) = answer.filter(|line| !line.trim().is_empty()) else {
            return Ok(None);
        };
        let number = line.trim().replace(',', ".").parse().ok();
        let voltage_v = number.filter(|number: &f32| number.is_finite() && *number > 0.0);
        if voltage_v.is_some() {
            return Ok(voltage_v);
        }
        session.show("A number above 0 is needed, as 12.6.");
    }
}

/// The mean of what the board reports from now on, in volts; `None` if no pack is connected.
fn shown_v(session: &mut Session<'_>) -> Result<Option<f32>, Interruption> {
    let before = session.record().received.len();
    session.listen_for(AVERAGING_US)?;
    let new = session.record().received.get(before..).unwrap_or_default();
    let voltages_v: Vec<_> = new
        .iter()
        .filter_map(|received| first_pack_v(&received.message))
        .collect();
    Ok(mean(&voltages_v))
}

/// The rate of parameter lists: nothing else depends on it.
const KEPT: &str = "SR0_PARAMS";

/// End of its range.
const KEPT_MAX: f32 = 50.0;

/// Original and new value of the trial. One that the trial gives to the default was left by a run that lost its board: the
/// default was the original, and the new one has to be another again.
fn originals(found: f32) -> (f32, f32) {
    let default = ParameterId::from(VehicleParameter::Sr0Params).default_value();
    if found == default + 1.0 {
        (default, default + 2.0)
    } else if found == default + 2.0 {
        (default, default + 1.0)
    } else if found < KEPT_MAX {
        (found, found + 1.0)
    } else {
        (found, found - 1.0)
    }
}

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: restart the autopilot.
const RESTART: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

/// Sets a parameter, restarts the board, and reads it, if the list had the parameter. Whatever ends it, the original value is
/// set again.
pub(super) fn keep_parameter(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    let Some(found) = evidence.parameter(KEPT) else {
        return Ok(());
    };
    let (old, new) = originals(found);
    let trial = evidence.kept.insert(KeptTrial {
        name: KEPT,
        found,
        old,
        new,
        answered: None,
        restarted: None,
        read: None,
        restored: None,
    });
    let ended = set_and_restart(session, trial);
    post_set(session, KEPT, old);
    ended?;
    trial.restored = answer_of(session, KEPT)?;
    Ok(())
}

fn set_and_restart(session: &mut Session<'_>, trial: &mut KeptTrial) -> Result<(), Interruption> {
    post_set(session, KEPT, trial.new);
    trial.answered = answer_of(session, KEPT)?;
    let restarted = session.restart(RESTART)?;
    trial.restarted = Some(restarted);
    if matches!(restarted, Restarted::After(_)) {
        trial.read = read(session, KEPT)?;
    }
    Ok(())
}

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: ArduPilot's numbers for a provoked fault.
const PROVOKE_FAULT: [f32; 4] = [42.0, 24.0, 71.0, 94.0];

/// The board reports a crash to the first ground station it hears: after our next heartbeat, two seconds at 9600 baud.
const REPORT_US: u64 = 4_000_000;

/// Provokes a fault and waits for its report.
pub(super) fn provoke_fault(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
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
