//! Is it this firmware's kind of vehicle?

use super::check::{Check, Outcome, failed, not_reached, outcome};
use crate::board_check::evidence::Evidence;
use crate::mavlink::COMPONENT_ID;
use crate::mavlink::dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavType};

pub(super) const CHECK: Check = Check {
    name: "identity",
    measures: "vehicle type, autopilot and component id in HEARTBEAT",
    expected: "ground rover, ArduPilot, component 1 (ground stations choose names and parameter formats by them)",
    advice: "Is this board running rover-battmon? Flash the release file again.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let mut heartbeats = evidence
        .record
        .received
        .iter()
        .filter_map(|received| match &received.message {
            MavMessage::HEARTBEAT(heartbeat) => Some(heartbeat),
            _ => None,
        });
    let (Some(heartbeat), Some((_, component_id))) = (heartbeats.next(), evidence.board) else {
        return not_reached();
    };
    let measured = measured(heartbeat, component_id);
    let is_expected = |heartbeat: &HEARTBEAT_DATA| {
        heartbeat.mavtype == MavType::MAV_TYPE_GROUND_ROVER
            && heartbeat.autopilot == MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA
    };
    if component_id != COMPONENT_ID {
        return failed(measured, format!("It sends as component {component_id}."));
    }
    let is_rover = is_expected(heartbeat) && heartbeats.all(is_expected);
    outcome(measured, (!is_rover).then_some("It is another kind of vehicle."))
}

fn measured(heartbeat: &HEARTBEAT_DATA, component_id: u8) -> String {
    let (kind, autopilot) = (heartbeat.mavtype, heartbeat.autopilot);
    format!("{kind:?}, {autopilot:?}, component {component_id}")
}
