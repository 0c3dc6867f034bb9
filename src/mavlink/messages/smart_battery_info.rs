//! SMART_BATTERY_INFO (370), which BATTERY_INFO supersedes: the same facts in whole numbers.

use super::pack_facts::{
    WEIGHT_UNKNOWN_G, battery_type, cells_in_series, charged_cell_voltage_v, cycle_count, design_capacity,
    full_capacity, lowest_cell_voltage_v, manufacture_date, name, serial_number,
};
use super::units::{MAX_VOLTAGE_MV, VOLTAGE_UNKNOWN_MV, finite, voltage_mv};
use crate::mavlink::dialect::{MavBatteryFunction, SMART_BATTERY_INFO_DATA};
use crate::numbers::round_to_i32;
use crate::pack::Pack;
use crate::system::SystemState;

/// MAVLink's value for a capacity that is not known.
const CAPACITY_UNKNOWN_MAH: i32 = -1;

/// MAVLink's value for the highest voltage of a cell that is not known; its lowest has `UINT16_MAX` for that.
const HIGHEST_VOLTAGE_UNKNOWN_MV: u16 = 0;

/// MAVLink's value for a highest current that is not known.
const HIGHEST_CURRENT_UNKNOWN_MA: u32 = 0;

/// What `pack` is, as far as its gauge reports it or its parameters say.
///
/// Any content of `state` gives a conforming message: unknown or impossible values become MAVLink's sentinels, large
/// ones saturate.
pub fn build_smart_battery_info(state: &SystemState<'_>, pack: Pack) -> SMART_BATTERY_INFO_DATA {
    let battery = state.battery(pack);
    let details = &battery.details;
    let charged_cell_v = charged_cell_voltage_v(battery);
    SMART_BATTERY_INFO_DATA {
        capacity_full_specification: capacity_mah(design_capacity(battery)),
        capacity_full: capacity_mah(full_capacity(battery)),
        cycle_count: cycle_count(details),
        weight: WEIGHT_UNKNOWN_G,
        discharge_minimum_voltage: cell_mv(lowest_cell_voltage_v(battery)).unwrap_or(VOLTAGE_UNKNOWN_MV),
        charging_minimum_voltage: VOLTAGE_UNKNOWN_MV,
        resting_minimum_voltage: VOLTAGE_UNKNOWN_MV,
        id: pack.instance(),
        battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL,
        mavtype: battery_type(battery),
        serial_number: serial_number(battery),
        device_name: name(details),
        charging_maximum_voltage: cell_mv(charged_cell_v).unwrap_or(HIGHEST_VOLTAGE_UNKNOWN_MV),
        cells_in_series: cells_in_series(battery),
        discharge_maximum_current: HIGHEST_CURRENT_UNKNOWN_MA,
        discharge_maximum_burst_current: HIGHEST_CURRENT_UNKNOWN_MA,
        manufacture_date: manufacture_date(details, "/"),
    }
}

fn capacity_mah(capacity_mah: Option<f32>) -> i32 {
    match finite(capacity_mah).filter(|capacity_mah| *capacity_mah >= 0.0) {
        Some(capacity_mah) => round_to_i32(capacity_mah),
        None => CAPACITY_UNKNOWN_MAH,
    }
}

fn cell_mv(voltage_v: Option<f32>) -> Option<u16> {
    voltage_mv(voltage_v).map(|voltage_mv| voltage_mv.min(u32::from(MAX_VOLTAGE_MV)) as u16)
}
