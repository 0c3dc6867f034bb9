//! BATTERY_STATUS (147).

use super::pack_facts::battery_type;
use super::units::{
    MAX_VOLTAGE_MV, VOLTAGE_UNKNOWN_MV, current_ca, finite, remaining_pct, temperature_cdegc, voltage_mv,
};
use crate::battery::{Amount, BatteryState, ChargeState, Faults};
use crate::mavlink::dialect::{
    BATTERY_STATUS_DATA, MavBatteryChargeState, MavBatteryFault, MavBatteryFunction, MavBatteryMode,
};
use crate::numbers::round_to_i32;
use crate::pack::Pack;
use crate::system::SystemState;

/// Cells in `voltages`.
const CELLS: usize = 10;

/// Cells in `voltages_ext`, which follow those.
const EXT_CELLS: usize = 4;

/// MAVLink's value for a cell of `voltages_ext` that is not used. Unlike in `voltages` it is 0: QGroundControl and
/// MAVProxy add a stray 65535 there as 65.5 V.
const UNUSED_EXT_CELL_MV: u16 = 0;

/// MAVLink's value for a consumed charge or energy that is not known.
const CONSUMED_UNKNOWN: i32 = -1;

/// MAVLink's value for a remaining time that is not known.
const TIME_REMAINING_UNKNOWN_S: i32 = 0;

/// Hectojoules (100 J) in a watt-hour, the unit of `energy_consumed`.
const HECTOJOULES_PER_WH: f32 = 36.0;

/// State of `pack`.
///
/// Any content of `state` gives a conforming message: unknown or impossible values become MAVLink's sentinels, large
/// ones saturate.
///
/// Cells that are measured are sent as they are, whichever of the pack's voltages is to be reported. While they aren't, or
/// are more than the message has fields for, that voltage stands in `voltages[0]`; above 65.534 V the rest spills into the
/// next cells, so that their sum is the pack's voltage.
pub fn build_battery_status(state: &SystemState<'_>, pack: Pack) -> BATTERY_STATUS_DATA {
    let battery = state.battery(pack);
    BATTERY_STATUS_DATA {
        id: pack.instance(),
        battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL,
        mavtype: battery_type(battery),
        temperature: temperature_cdegc(battery.temperature_c),
        voltages: voltages(battery),
        current_battery: current_ca(battery.rate()),
        current_consumed: consumed(battery.consumed.map(Amount::number)),
        energy_consumed: consumed(battery.consumed_wh.map(|wh| wh * HECTOJOULES_PER_WH)),
        battery_remaining: remaining_pct(battery.readings.remaining_pct),
        time_remaining: time_remaining_s(battery.readings.time_remaining_s),
        charge_state: charge_state(battery.charge_state),
        voltages_ext: ext_cells(cells(battery)),
        mode: MavBatteryMode::MAV_BATTERY_MODE_UNKNOWN,
        fault_bitmask: fault_bitmask(battery.faults_to_show()),
    }
}

/// The measured cells, if the message has fields for all of them.
fn cells(battery: &BatteryState) -> &[u16] {
    match battery.cells.count() <= CELLS + EXT_CELLS {
        true => battery.cells.millivolts(),
        false => &[],
    }
}

fn voltages(battery: &BatteryState) -> [u16; CELLS] {
    let measured = cells(battery);
    if measured.is_empty() {
        return pack_voltage_cells(battery.voltage_to_report_v());
    }
    let mut cells = [VOLTAGE_UNKNOWN_MV; CELLS];
    for (cell, measured_mv) in cells.iter_mut().zip(measured) {
        *cell = (*measured_mv).min(MAX_VOLTAGE_MV);
    }
    cells
}

/// The cells behind the tenth. One that is at 0 V is sent as 1 mV, since 0 is unused.
fn ext_cells(measured: &[u16]) -> [u16; EXT_CELLS] {
    let mut cells = [UNUSED_EXT_CELL_MV; EXT_CELLS];
    for (cell, measured_mv) in cells.iter_mut().zip(measured.iter().skip(CELLS)) {
        *cell = (*measured_mv).clamp(1, MAX_VOLTAGE_MV);
    }
    cells
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

/// Less than a second left is sent as a second, since 0 is unknown.
fn time_remaining_s(time_remaining_s: Option<f32>) -> i32 {
    match finite(time_remaining_s) {
        Some(time_remaining_s) => round_to_i32(time_remaining_s).max(1),
        None => TIME_REMAINING_UNKNOWN_S,
    }
}

fn charge_state(charge_state: ChargeState) -> MavBatteryChargeState {
    match charge_state {
        ChargeState::Undefined => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_UNDEFINED,
        ChargeState::Ok => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_OK,
        ChargeState::Low => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_LOW,
        ChargeState::Critical => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_CRITICAL,
        ChargeState::Emergency => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_EMERGENCY,
        ChargeState::Failed => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_FAILED,
        ChargeState::Unhealthy => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_UNHEALTHY,
        ChargeState::Charging => MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_CHARGING,
    }
}

/// The bits are MAVLink's own. A bad battery has none: that of a failed cell says that it must not be used, too.
fn fault_bitmask(mut faults: Faults) -> MavBatteryFault {
    if faults.contains(Faults::BAD_BATTERY) {
        faults |= Faults::CELL_FAIL;
    }
    MavBatteryFault::from_bits_truncate(u32::from((faults & Faults::MAVLINK).bits()))
}
