//! BAT: what is measured of a pack.

use super::format::Kind;
use super::packet::{Packet, RecordBytes, finite, whole_pct};
use crate::battery::{Amount, BatteryState, PackStatus};
use crate::pack::Pack;
use crate::rounding::round_to_i32;

/// A temperature that is unknown, as in ArduPilot.
const TEMPERATURE_UNKNOWN_CDEGC: i16 = 0;

/// A remaining charge that is unknown, as in ArduPilot.
const REMAINING_UNKNOWN_PCT: u8 = u8::MAX;

/// A state of health that is unknown, as in ArduPilot.
const STATE_OF_HEALTH_UNKNOWN_PCT: u8 = 0;

/// `Volt` is the terminal voltage, whichever is reported to ground stations. The charge of a tank is in millilitres.
pub(super) fn encode(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    Packet::at(Kind::Battery, time_us)
        .u8(pack.instance())
        .number(state.voltage_v)
        .number(state.resting_voltage_v)
        .number(state.current_a)
        .number(state.consumed.map(Amount::number))
        .number(state.consumed_wh)
        .bytes(&temperature_cdegc(state.temperature_c).to_le_bytes())
        .number(state.resistance_ohm)
        .u8(finite(state.remaining_pct).map_or(REMAINING_UNKNOWN_PCT, whole_pct))
        .u8(u8::from(state.status == PackStatus::Healthy))
        .u8(state.state_of_health_pct.unwrap_or(STATE_OF_HEALTH_UNKNOWN_PCT))
        .finish()
}

/// In hundredths of a degree, saturating at ±327.67 °C. A true 0.00 °C would read as unknown and is recorded as 0.01 °C.
fn temperature_cdegc(temperature_c: Option<f32>) -> i16 {
    let Some(temperature_c) = finite(temperature_c) else {
        return TEMPERATURE_UNKNOWN_CDEGC;
    };
    let limit = i32::from(i16::MAX);
    match round_to_i32(temperature_c * 100.0).clamp(-limit, limit) as i16 {
        TEMPERATURE_UNKNOWN_CDEGC => 1,
        known => known,
    }
}
