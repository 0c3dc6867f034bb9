//! HEARTBEAT (0).

use crate::mavlink::dialect::{HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType};

/// ArduPilot Rover's number for the mode HOLD: the vehicle stands still.
const ROVER_MODE_HOLD: u32 = 4;

/// MAVLink protocol version 2 is announced as 3, as every autopilot does.
const MAVLINK_VERSION: u8 = 3;

/// An ArduPilot rover that stands by. This identity is the one with which all common ground stations read parameters
/// and batteries right.
pub fn build_heartbeat() -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        custom_mode: ROVER_MODE_HOLD,
        mavtype: MavType::MAV_TYPE_GROUND_ROVER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        system_status: MavState::MAV_STATE_STANDBY,
        mavlink_version: MAVLINK_VERSION,
    }
}
