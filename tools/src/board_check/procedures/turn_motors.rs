//! Turns the wheels, one side after the other, and asks the owner what they did; then all of them, and measures the pack.
//!
//! Whatever ends a step, the rover is disarmed. Should this program end first, the firmware's
//! own time-out of control inputs (`FS_TIMEOUT`) stops the motors.

use std::ops::RangeInclusive;

use rover_battmon::mavlink::dialect::{MANUAL_CONTROL_DATA, MavCmd, MavMessage, MavResult};
use rover_battmon::time::Instant;

use crate::board_check::evidence::{Evidence, Interruption, Load, LoadWindows, MotorStep, StepResult, Trial};
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

/// Throttles, of a thousand: one that starts wheels at rest, and those at which the pack is measured. At half throttle free
/// wheels draw 83 to 96 % of the current of full throttle, at a fifth 34 to 82 % (computed for 2 to 8 Ω, 0.5 to 3 mH).
const STARTING: i16 = 500;
const FIFTH: i16 = 200;
const FULL: i16 = 1000;

/// Until a pack has recovered from a load, and until wheels turn steadily.
const RECOVERY_US: u64 = 3_000_000;
const STEADY_US: u64 = 1_500_000;
/// Some readings are averaged.
const AVERAGING_US: u64 = 2_000_000;
const START_US: u64 = 500_000;

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

/// Goes through all steps, if the wheels are off the ground. If they turned as expected, measures the pack under their load.
pub fn turn_motors(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    let question = "The wheels will turn, in the end at full speed. Is the rover on a stand, all wheels off the ground and \
                    clear? [y/n]";
    evidence.loads = Trial::Done(LoadWindows::new());
    if confirm(session, question)? != StepResult::Confirmed {
        evidence.motors = Trial::Done(Vec::new());
        return Ok(());
    }
    let results = turn_sides(session, evidence)?;
    if results.iter().all(|(_, result)| *result == StepResult::Confirmed) {
        session.show("  all wheels ahead, for some seconds at full speed");
        measure_loads(session, evidence)?;
    }
    Ok(())
}

fn turn_sides(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
) -> Result<Vec<(MotorStep, StepResult)>, Interruption> {
    let mut results = Vec::new();
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
    Ok(results)
}

/// Turns the wheels of a step; returns why it could not.
fn turn(session: &mut Session<'_>, step: MotorStep) -> Result<Option<StepResult>, Interruption> {
    let (steering, throttle) = step.direction();
    let inputs = (1..=INPUTS).map(|input| {
        let deflection = (input * RAMP).min(DEFLECTION);
        (steering * deflection, throttle * deflection)
    });
    drive(session, inputs)
}

/// Measures the pack at a fifth of full throttle and at full throttle, and before each at rest, so that it has recovered alike.
fn measure_loads(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    let rate = evidence.parameter("MOT_SLEWRATE").unwrap_or(0.0);
    let mut windows = LoadWindows::new();
    for (load, throttle) in [(Load::Fifth, FIFTH), (Load::Full, FULL)] {
        session.listen_for(RECOVERY_US)?;
        windows.push((Load::None, last(session)));
        let starting = held(STARTING, START_US + ramp_us(STARTING, rate));
        let measured = held(throttle, ramp_us(FULL, rate) + STEADY_US + AVERAGING_US);
        let driven = drive(session, starting.chain(measured));
        let window = last(session);
        stop(session);
        if driven?.is_some() {
            break;
        }
        windows.push((load, window));
        evidence.loads = Trial::Done(windows.clone());
    }
    session.listen_for(STANDSTILL_US)
}

/// A stick that stays at a throttle.
fn held(throttle: i16, us: u64) -> impl Iterator<Item = (i16, i16)> {
    (0..us / CONTROL_INTERVAL_US).map(move |_| (0, throttle))
}

/// Duration of the firmware's way to a throttle, in microseconds, at this rate in percent a second; 0 is at once.
fn ramp_us(throttle: i16, rate: f32) -> u64 {
    let seconds = if rate > 0.0 {
        f32::from(throttle) / 10.0 / rate
    } else {
        0.0
    };
    (seconds * 1e6) as u64
}

/// The time in which the latest readings were received.
fn last(session: &mut Session<'_>) -> RangeInclusive<Instant> {
    let now = session.now();
    now.before_us(AVERAGING_US)..=now
}

/// Arms, and moves the sticks, steering and throttle; returns why it could not.
fn drive(
    session: &mut Session<'_>,
    inputs: impl Iterator<Item = (i16, i16)>,
) -> Result<Option<StepResult>, Interruption> {
    let port_losses = session.record().port_losses.len();
    let texts = session.record().texts().len();
    steer(session, 0, 0);
    session.command(MavCmd::MAV_CMD_DO_SET_MODE, MANUAL)?;
    if session.command(ARM_DISARM, ARM)? != Some(MavResult::MAV_RESULT_ACCEPTED) {
        let new = session.record().texts().split_off(texts);
        let reasons: Vec<_> = new.into_iter().map(|text| text.text).collect();
        return Ok(Some(StepResult::NotArmed(reasons.join(", "))));
    }
    for (steering, throttle) in inputs {
        steer(session, steering, throttle);
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
