//! HEARTBEAT (0).

use crate::mavlink::dialect::{HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType};
use crate::system::SystemState;
use crate::vehicle::ArmState;
use crate::vehicle::{Alert, Mode, VehicleStatus};

/// MAVLink protocol version 2 is announced as 3, as every autopilot does.
const MAVLINK_VERSION: u8 = 3;

/// An ArduPilot rover, its mode and whether it is armed. This identity is the one with which all common ground stations
/// read parameters and batteries right.
pub fn build_heartbeat(state: &SystemState<'_>) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        custom_mode: state.vehicle.mode.number(),
        mavtype: MavType::MAV_TYPE_GROUND_ROVER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode: base_mode(&state.vehicle),
        system_status: system_status(&state.vehicle),
        mavlink_version: MAVLINK_VERSION,
    }
}

fn base_mode(vehicle: &VehicleStatus) -> MavModeFlag {
    let mut flags = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
    flags.set(
        MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
        vehicle.arm_state == ArmState::Armed,
    );
    flags.set(
        MavModeFlag::MAV_MODE_FLAG_MANUAL_INPUT_ENABLED,
        vehicle.mode == Mode::Manual,
    );
    flags
}

/// As ArduPilot's Rover: ground stations call a rover that is active in motion, and offer its emergency stop only.
fn system_status(vehicle: &VehicleStatus) -> MavState {
    match (vehicle.alert, vehicle.arm_state, vehicle.mode) {
        (Alert::Terminated, ..) => MavState::MAV_STATE_EMERGENCY,
        (Alert::TimedOut, ..) => MavState::MAV_STATE_CRITICAL,
        (Alert::None, ArmState::Disarmed, _) | (Alert::None, _, Mode::Hold) => MavState::MAV_STATE_STANDBY,
        (Alert::None, ArmState::Armed, Mode::Manual) => MavState::MAV_STATE_ACTIVE,
    }
}
