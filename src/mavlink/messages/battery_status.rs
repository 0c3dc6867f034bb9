//! BATTERY_STATUS (147).

use super::units::{
    MAX_VOLTAGE_MV, VOLTAGE_UNKNOWN_MV, current_ca, finite, remaining_pct, round_to_i32, voltage_mv,
};
use crate::battery::PackStatus;
use crate::mavlink::SystemState;
use crate::mavlink::dialect::{
    BATTERY_STATUS_DATA, MavBatteryChargeState, MavBatteryFault, MavBatteryFunction, MavBatteryMode,
    MavBatteryType,
};

/// Cells in `voltages`; four more follow in `voltages_ext`.
const CELLS: usize = 10;

/// MAVLink's value for a cell of `voltages_ext` that is not used. Unlike in `voltages` it is 0: QGroundControl and
/// MAVProxy add a stray 65535 there as 65.5 V.
const UNUSED_EXT_CELL_MV: u16 = 0;

/// MAVLink's value for a consumed charge or energy that is not known.
const CONSUMED_UNKNOWN: i32 = -1;

/// MAVLink's value for a temperature that is not known, `INT16_MAX`.
const TEMPERATURE_UNKNOWN_CDEGC: i16 = i16::MAX;

/// MAVLink's value for a remaining time that is not known.
const TIME_REMAINING_UNKNOWN_S: i32 = 0;

/// Hectojoules (100 J) in a watt-hour, the unit of `energy_consumed`.
const HECTOJOULES_PER_WH: f32 = 36.0;

/// What is known of the pack `instance` (0-based).
///
/// Any content of `state` gives a conforming message: unknown or impossible values become MAVLink's sentinels, large
/// ones saturate. The pack's voltage stands in `voltages[0]` while single cells aren't measured; above 65.534 V the rest
/// spills into the next cells, so that their sum is the pack's voltage.
pub fn build_battery_status(state: &SystemState, instance: u8) -> BATTERY_STATUS_DATA {
    let battery = state.battery(instance);
    BATTERY_STATUS_DATA {
        id: instance,
        battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL,
        mavtype: MavBatteryType::MAV_BATTERY_TYPE_LIPO,
        temperature: temperature_cdegc(battery.temperature_c),
        voltages: pack_voltage_cells(battery.voltage_v),
        current_battery: current_ca(battery.current_a),
        current_consumed: consumed(battery.consumed_mah),
        energy_consumed: consumed(battery.consumed_wh.map(|wh| wh * HECTOJOULES_PER_WH)),
        battery_remaining: remaining_pct(battery.remaining_pct),
        time_remaining: time_remaining_s(battery.time_remaining_s),
        charge_state: charge_state(battery.status),
        voltages_ext: [UNUSED_EXT_CELL_MV; 4],
        mode: MavBatteryMode::MAV_BATTERY_MODE_UNKNOWN,
        fault_bitmask: MavBatteryFault::empty(),
    }
}

fn pack_voltage_cells(voltage_v: Option<f32>) -> [u16; CELLS] {
    let mut cells = [VOLTAGE_UNKNOWN_MV; CELLS];
    let Some(mut rest_mv) = voltage_mv(voltage_v) else {
        return cells;
    };
    for cell in &mut cells {
        let part_mv = rest_mv.min(u32::from(MAX_VOLTAGE_MV));
        *cell = part_mv as u16;
        rest_mv -= part_mv;
        if rest_mv == 0 {
            break;
        }
    }
    cells
}

/// Net charging is not expressible (−1 is unknown): it is sent as nothing consumed.
fn consumed(amount: Option<f32>) -> i32 {
    match finite(amount) {
        Some(amount) => round_to_i32(amount).max(0),
        None => CONSUMED_UNKNOWN,
    }
}

fn temperature_cdegc(temperature_c: Option<f32>) -> i16 {
    match finite(temperature_c) {
        Some(temperature_c) => {
            let highest = i32::from(TEMPERATURE_UNKNOWN_CDEGC - 1);
            round_to_i32(temperature_c * 100.0).clamp(i32::from(i16::MIN), highest) as i16
        }
        None => TEMPERATURE_UNKNOWN_CDEGC,
    }
}

/// Less than a second left is sent as a second, since 0 is unknown.
fn time_remaining_s(time_remaining_s: Option<f32>) -> i32 {
    match finite(time_remaining_s) {
        Some(time_remaining_s) => round_to_i32(time_remaining_s).max(1),
        None => TIME_REMAINING_UNKNOWN_S,
    }
}

fn charge_state(status: PackStatus) -> MavBatteryChargeState {
    match status {
        PackStatus::Healthy => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_OK,
        PackStatus::Unhealthy => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_UNHEALTHY,
        PackStatus::Disabled | PackStatus::Unknown | PackStatus::NotConnected => {
            MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_UNDEFINED
        }
    }
}
