//! Turns the wheels, one side after the other, and asks the owner what they did.
//!
//! Whatever ends a step, the rover is disarmed. Should this program end first, the firmware's
//! own time-out of control inputs (`FS_TIMEOUT`) stops the motors.

use rover_battmon::mavlink::dialect::{MANUAL_CONTROL_DATA, MavCmd, MavMessage, MavResult};

use crate::board_check::evidence::{Evidence, Interruption, MotorStep, StepResult, Trial};
use crate::board_check::session::Session;

const ARM_DISARM: MavCmd = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM;
const ARM: [f32; 4] = [1.0, 0.0, 0.0, 0.0];
const DISARM: [f32; 4] = [0.0; 4];

/// MAV_CMD_DO_SET_MODE: ArduPilot's own modes, MANUAL.
const MANUAL: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

/// Control inputs are repeated well within `FS_TIMEOUT`.
const CONTROL_INTERVAL_US: u64 = 50_000;

/// The sticks move in small steps, so that throttle, which the firmware ramps, and steering stay together and the other
/// side stands still.
const RAMP: i16 = 20;
/// Of a thousand: both sticks together are 40 % of full power.
const DEFLECTION: i16 = 200;
/// Control inputs of a step: half a second of ramp, and a second and a half.
const INPUTS: i16 = 40;

/// Until the wheels stand still.
const STANDSTILL_US: u64 = 500_000;

/// What stops the motors must arrive, so it is repeated.
const STOP_ATTEMPTS: usize = 3;

impl MotorStep {
    /// Steering and throttle, of −1, 0 or 1: the sum drives the left wheels, the difference the right ones.
    fn direction(self) -> (i16, i16) {
        match self {
            Self::LeftAhead => (1, 1),
            Self::RightAhead => (-1, 1),
            Self::LeftBack => (-1, -1),
            Self::RightBack => (1, -1),
        }
    }

    fn question(self) -> String {
        let (turning, direction, still) = match self {
            Self::LeftAhead => ("left", "ahead", "right"),
            Self::RightAhead => ("right", "ahead", "left"),
            Self::LeftBack => ("left", "back", "right"),
            Self::RightBack => ("right", "back", "left"),
        };
        format!("Did both {turning} wheels turn {direction}, and both {still} wheels stand still? [y/n]")
    }
}

/// Goes through all steps, if the wheels are off the ground.
pub fn turn_motors(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    let question =
        "The wheels will turn. Is the rover on a stand, all wheels off the ground and clear? [y/n]";
    let mut results = Vec::new();
    if confirm(session, question)? != StepResult::Confirmed {
        evidence.motors = Trial::Done(results);
        return Ok(());
    }
    for step in MotorStep::ALL {
        session.show(&format!("  {}", step.name()));
        let turned = turn(session, step);
        stop(session);
        let turned = turned?;
        session.listen_for(STANDSTILL_US)?;
        let result = match turned {
            None => confirm(session, &step.question())?,
            Some(failed) => failed,
        };
        results.push((step, result));
        evidence.motors = Trial::Done(results.clone());
    }
    Ok(())
}

/// Arms, and moves the sticks; returns why it could not.
fn turn(session: &mut Session<'_>, step: MotorStep) -> Result<Option<StepResult>, Interruption> {
    let port_losses = session.record().port_losses.len();
    let texts = session.record().texts().len();
    steer(session, 0, 0);
    session.command(MavCmd::MAV_CMD_DO_SET_MODE, MANUAL)?;
    if session.command(ARM_DISARM, ARM)? != Some(MavResult::MAV_RESULT_ACCEPTED) {
        let new = session.record().texts().split_off(texts);
        let reasons: Vec<_> = new.into_iter().map(|text| text.text).collect();
        return Ok(Some(StepResult::NotArmed(reasons.join(", "))));
    }
    let (steering, throttle) = step.direction();
    for input in 1..=INPUTS {
        let deflection = (input * RAMP).min(DEFLECTION);
        steer(session, steering * deflection, throttle * deflection);
        session.listen_for(CONTROL_INTERVAL_US)?;
        if session.record().port_losses.len() > port_losses {
            return Ok(Some(StepResult::Interrupted));
        }
    }
    Ok(None)
}

/// Disarms, which lets the wheels roll at once, and centres the sticks: centred first, the ramp of the throttle would turn
/// the other side for a moment. It waits for nothing, so nothing keeps it from being sent.
fn stop(session: &mut Session<'_>) {
    for _ in 0..STOP_ATTEMPTS {
        session.post_command(ARM_DISARM, DISARM);
        steer(session, 0, 0);
    }
}

fn steer(session: &mut Session<'_>, steering: i16, throttle: i16) {
    let target = session.system_id();
    session.send(&MavMessage::MANUAL_CONTROL(MANUAL_CONTROL_DATA {
        x: 0,
        y: steering,
        z: throttle,
        target,
        ..MANUAL_CONTROL_DATA::DEFAULT
    }));
}

fn confirm(session: &mut Session<'_>, question: &str) -> Result<StepResult, Interruption> {
    let answer = session.ask(question)?.unwrap_or_default();
    Ok(match answer.trim().to_lowercase().as_str() {
        "y" | "yes" => StepResult::Confirmed,
        "n" | "no" => StepResult::Denied,
        _ => StepResult::Unanswered,
    })
}
