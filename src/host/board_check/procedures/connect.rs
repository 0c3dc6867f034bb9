//! Finds the board and asks which it is.

use ::mavlink::MessageData;

use super::super::evidence::Evidence;
use super::super::session::{Interruption, Session};
use crate::mavlink::dialect::{AUTOPILOT_VERSION_DATA, MavCmd, MavMessage};

/// Five heartbeats; a board that was just plugged in needs a second to start.
const HEARTBEAT_TIMEOUT_US: u64 = 5_000_000;

const VERSION_TIMEOUT_US: u64 = 1_000_000;
const ATTEMPTS: usize = 3;

/// Waits for an autopilot's heartbeat.
pub(in super::super) fn connect(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
) -> Result<(), Interruption> {
    let began = session.now();
    session.wait_for(HEARTBEAT_TIMEOUT_US, |message| {
        matches!(message, MavMessage::HEARTBEAT(_)).then_some(())
    })?;
    evidence.board = session.board();
    evidence.connected_after_us = session.now().us_since(began);
    Ok(())
}

/// Asks for AUTOPILOT_VERSION.
pub(in super::super) fn identify(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
) -> Result<(), Interruption> {
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
