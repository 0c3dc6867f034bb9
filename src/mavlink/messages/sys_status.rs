//! SYS_STATUS (1).

use super::units::{MAX_VOLTAGE_MV, VOLTAGE_UNKNOWN_MV, current_ca, remaining_pct, voltage_mv};
use crate::battery::{BatteryState, Consequences, PackStatus, consequences};
use crate::mavlink::dialect::{MavSysStatusSensor, MavSysStatusSensorExtended, SYS_STATUS_DATA};
use crate::pack::Pack;
use crate::system::{ArmingReadiness, LogHealth, ReceiveStatistics, SystemState};
use crate::vehicle::ArmState;

/// The primary pack's voltage, current and remaining charge, whether all packs are healthy, the processor's load and
/// the link's losses.
///
/// The primary pack is instance 0, even one that has no BATTERY_STATUS of its own.
///
/// Any content of `state` gives a conforming message: unknown or impossible values become MAVLink's sentinels, large
/// ones saturate.
pub fn build_sys_status(state: &SystemState<'_>) -> SYS_STATUS_DATA {
    let battery = state.battery(Pack::First);
    SYS_STATUS_DATA {
        onboard_control_sensors_present: present_sensors(state),
        onboard_control_sensors_enabled: enabled_sensors(state),
        onboard_control_sensors_health: healthy_sensors(state),
        load: state.load_permille.min(1000),
        voltage_battery: pack_voltage_mv(battery),
        current_battery: current_ca(battery.rate()),
        drop_rate_comm: drop_rate_percent_hundredths(&state.link.received),
        errors_comm: saturate(state.link.received.errors()),
        // ArduPilot's mask of internal errors: Mission Planner shows anything else as an internal error, for ever.
        errors_count1: 0,
        errors_count2: 0,
        // Messages dropped for lack of room. Those that were not signed as required are announced.
        errors_count3: saturate(state.link.dropped),
        // ArduPilot's count of internal errors.
        errors_count4: 0,
        battery_remaining: remaining_pct(battery.readings.remaining_pct),
        onboard_control_sensors_present_extended: MavSysStatusSensorExtended::empty(),
        onboard_control_sensors_enabled_extended: MavSysStatusSensorExtended::empty(),
        onboard_control_sensors_health_extended: MavSysStatusSensorExtended::empty(),
    }
}

fn saturate(count: u32) -> u16 {
    count.min(u32::from(u16::MAX)) as u16
}

/// The share of what was received that was lost, in hundredths of a percent.
fn drop_rate_percent_hundredths(received: &ReceiveStatistics) -> u16 {
    let lost = u64::from(received.errors());
    let all = lost + u64::from(received.frames);
    // At most 10000.
    (lost * 10_000).checked_div(all).unwrap_or(0) as u16
}

/// The motors, the arming checks, the log, and the packs if any is monitored. Without the bit of the motors Mission Planner shows
/// a safety switch that is on; without the one of the checks, readiness to arm.
fn present_sensors(state: &SystemState<'_>) -> MavSysStatusSensor {
    let mut sensors = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        | MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK
        | MavSysStatusSensor::MAV_SYS_STATUS_LOGGING;
    sensors.set(
        MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY,
        state.monitored().next().is_some(),
    );
    sensors
}

/// The present ones that are in use.
fn enabled_sensors(state: &SystemState<'_>) -> MavSysStatusSensor {
    let mut sensors = present_sensors(state);
    sensors.set(
        MavSysStatusSensor::MAV_SYS_STATUS_LOGGING,
        state.log != LogHealth::Off,
    );
    sensors
}

/// The sound ones among them, and a fence that is not breached, since there is none: MAVProxy announces a breach by
/// the bit of its health alone.
fn healthy_sensors(state: &SystemState<'_>) -> MavSysStatusSensor {
    let mut sensors = present_sensors(state) | MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE;
    sensors.set(
        MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK,
        state.readiness == ArmingReadiness::Ready,
    );
    sensors.set(
        MavSysStatusSensor::MAV_SYS_STATUS_LOGGING,
        state.log != LogHealth::Failed,
    );
    // One bit stands for all packs.
    let mut packs = state.monitored();
    if !packs.all(|battery| is_healthy(battery, state.vehicle.arm_state)) {
        sensors.remove(MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY);
    }
    sensors
}

/// Until its first reading nothing is wrong with a pack, nor while a disarmed rover has none: Mission Planner would
/// announce a bad battery after every start, and without end on a desk. What gives no reading is unhealthy soon.
fn is_healthy(battery: &BatteryState, arm_state: ArmState) -> bool {
    let is_gone = battery.status == PackStatus::NotConnected && arm_state == ArmState::Armed;
    !is_gone && !consequences(battery).contains(Consequences::NOT_HEALTHY)
}

fn pack_voltage_mv(battery: &BatteryState) -> u16 {
    match voltage_mv(battery.voltage_to_report_v()) {
        Some(voltage_mv) => voltage_mv.min(u32::from(MAX_VOLTAGE_MV)) as u16,
        None => VOLTAGE_UNKNOWN_MV,
    }
}
