//! BATTERY_INFO (372), and SMART_BATTERY_INFO (370), which it supersedes: the same facts in whole numbers.

use super::pack_facts::{
    WEIGHT_UNKNOWN_G, battery_type, cells_in_series, charged_cell_voltage_v, cycle_count, design_capacity,
    full_capacity, lowest_cell_voltage_v, manufacture_date, name, nominal_voltage_v, serial_number,
};
use super::units::{
    MAX_VOLTAGE_MV, NOT_GIVEN, VOLTAGE_UNKNOWN_MV, amp_hours, finite, number, number_above_zero, voltage_mv,
};
use crate::battery::BatteryState;
use crate::mavlink::dialect::{BATTERY_INFO_DATA, MavBatteryFunction, SMART_BATTERY_INFO_DATA};
use crate::numbers::round_to_i32;
use crate::pack::Pack;
use crate::system::SystemState;

/// MAVLink's value for a state of health that is not known: its −1, in a byte without sign.
const HEALTH_UNKNOWN_PCT: u8 = u8::MAX;

/// Facts of `pack`, as far as its gauge reports them or its parameters say.
///
/// Any content of `state` gives a conforming message: unknown or impossible values become MAVLink's sentinels.
pub fn build_battery_info(state: &SystemState<'_>, pack: Pack) -> BATTERY_INFO_DATA {
    let battery = state.battery(pack);
    let details = &battery.details;
    BATTERY_INFO_DATA {
        discharge_minimum_voltage: number_above_zero(lowest_cell_voltage_v(battery)),
        charging_minimum_voltage: NOT_GIVEN,
        resting_minimum_voltage: NOT_GIVEN,
        charging_maximum_voltage: number_above_zero(charged_cell_voltage_v(battery)),
        charging_maximum_current: NOT_GIVEN,
        nominal_voltage: number_above_zero(nominal_voltage_v(battery)),
        discharge_maximum_current: NOT_GIVEN,
        discharge_maximum_burst_current: NOT_GIVEN,
        design_capacity: number_above_zero(amp_hours(design_capacity(battery))),
        full_charge_capacity: number(amp_hours(full_capacity(battery)).filter(|charge_ah| *charge_ah >= 0.0)),
        cycle_count: cycle_count(details),
        weight: WEIGHT_UNKNOWN_G,
        id: pack.instance(),
        battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL,
        mavtype: battery_type(battery),
        state_of_health: health_pct(battery),
        cells_in_series: cells_in_series(battery),
        manufacture_date: manufacture_date(details, ""),
        serial_number: serial_number(battery),
        name: name(details),
    }
}

/// A gauge may count more than it held when it was new.
fn health_pct(battery: &BatteryState) -> u8 {
    match battery.state_of_health_pct {
        Some(percent) => percent.min(100),
        None => HEALTH_UNKNOWN_PCT,
    }
}

/// MAVLink's value for a capacity that is not known.
const CAPACITY_UNKNOWN_MAH: i32 = -1;

/// MAVLink's value for the highest voltage of a cell that is not known; its lowest has `UINT16_MAX` for that.
const HIGHEST_VOLTAGE_UNKNOWN_MV: u16 = 0;

/// MAVLink's value for a highest current that is not known.
const HIGHEST_CURRENT_UNKNOWN_MA: u32 = 0;

/// Facts of `pack`, as far as its gauge reports them or its parameters say.
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
