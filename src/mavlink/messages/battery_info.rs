//! BATTERY_INFO (372).

use super::pack_facts::{
    WEIGHT_UNKNOWN_G, battery_type, cells_in_series, charged_cell_voltage_v, cycle_count, design_capacity,
    full_capacity, lowest_cell_voltage_v, manufacture_date, name, nominal_voltage_v, serial_number,
};
use super::units::{NOT_GIVEN, amp_hours, number, number_above_zero};
use crate::battery::BatteryState;
use crate::mavlink::dialect::{BATTERY_INFO_DATA, MavBatteryFunction};
use crate::pack::Pack;
use crate::system::SystemState;

/// MAVLink's value for a state of health that is not known: its −1, in a byte without sign.
const HEALTH_UNKNOWN_PCT: u8 = u8::MAX;

/// What `pack` is, as far as its gauge reports it or its parameters say.
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
