//! FUEL_STATUS (371).

use super::units::{finite, number};
use crate::battery::{BatteryState, ChargeSource};
use crate::mavlink::dialect::{FUEL_STATUS_DATA, MavFuelType};
use crate::numbers::round_to_i32;
use crate::pack::Pack;
use crate::system::SystemState;

/// MAVLink's value for a level that is not known, `UINT8_MAX`.
const LEVEL_UNKNOWN_PCT: u8 = u8::MAX;

/// A litre an hour, in millilitres a second.
const ML_PER_S: f32 = 1000.0 / 3600.0;

const KELVIN_AT_0_CELSIUS: f32 = 273.15;

/// State of the tank `pack`.
///
/// Any content of `state` gives a conforming message: unknown or impossible values become MAVLink's sentinels. What is left
/// and what was used is reported as far as it was measured: the one by a level sensor, the other by a flow sensor. The level in
/// percent is reported by both.
pub fn build_fuel_status(state: &SystemState<'_>, pack: Pack) -> FUEL_STATUS_DATA {
    let tank = state.battery(pack);
    let is_level_measured = tank.charge_source == ChargeSource::Gauge;
    FUEL_STATUS_DATA {
        maximum_fuel: number(tank.capacity_ml()),
        consumed_fuel: number(tank.consumed_ml().filter(|_| !is_level_measured)),
        remaining_fuel: number(remaining_ml(tank).filter(|_| is_level_measured)),
        flow_rate: number(tank.readings.fuel_l_h.map(|flow_l_h| flow_l_h * ML_PER_S)),
        temperature: number(tank.temperature_c.map(|celsius| celsius + KELVIN_AT_0_CELSIUS)),
        fuel_type: MavFuelType::MAV_FUEL_TYPE_LIQUID,
        id: pack.instance(),
        percent_remaining: match finite(tank.readings.remaining_pct) {
            Some(percent) => round_to_i32(percent).clamp(0, 100) as u8,
            None => LEVEL_UNKNOWN_PCT,
        },
    }
}

fn remaining_ml(tank: &BatteryState) -> Option<f32> {
    let share = finite(tank.readings.remaining_pct)?.clamp(0.0, 100.0) / 100.0;
    Some(tank.capacity_ml()? * share)
}
