//! From SI values to MAVLink's integers: rounded to nearest, saturated, and never onto a sentinel by accident.

use crate::numbers::round_to_i32;
use crate::time::Instant;

const MICROSECONDS_PER_MILLISECOND: u64 = 1000;

/// Time since the start, in ms. As every autopilot's, it starts again after 49 days.
pub fn time_boot_ms(now: Instant) -> u32 {
    (now.as_micros() / MICROSECONDS_PER_MILLISECOND) as u32
}

/// A number that is neither NaN nor infinite.
pub fn finite(value: Option<f32>) -> Option<f32> {
    value.filter(|value| value.is_finite())
}

/// MAVLink's value for a voltage that is not known, `UINT16_MAX`.
pub const VOLTAGE_UNKNOWN_MV: u16 = u16::MAX;

/// The largest voltage one field can carry, in mV; one more would read as unknown.
pub const MAX_VOLTAGE_MV: u16 = u16::MAX - 1;

/// A pack's voltage in mV. Nothing a pack can't have (NaN, infinite, negative) passes for a voltage.
pub fn voltage_mv(voltage_v: Option<f32>) -> Option<u32> {
    finite(voltage_v)
        .filter(|voltage_v| *voltage_v >= 0.0)
        .map(|voltage_v| round_to_i32(voltage_v * 1000.0).unsigned_abs())
}

/// MAVLink's value for a current that is not known.
const CURRENT_UNKNOWN_CA: i16 = -1;

/// A current in cA (10 mA), saturating at ±327.67 A. A true −10 mA would read as unknown and is sent as 0.
pub fn current_ca(current_a: Option<f32>) -> i16 {
    let Some(current_a) = finite(current_a) else {
        return CURRENT_UNKNOWN_CA;
    };
    let limit = i32::from(i16::MAX);
    match round_to_i32(current_a * 100.0).clamp(-limit, limit) as i16 {
        CURRENT_UNKNOWN_CA => 0,
        known => known,
    }
}

/// MAVLink's value for a temperature that is not known, `INT16_MAX`.
const TEMPERATURE_UNKNOWN_CDEGC: i16 = i16::MAX;

/// A temperature in hundredths of a degree, saturating at −327.68 and 327.66 °C.
pub fn temperature_cdegc(temperature_c: Option<f32>) -> i16 {
    match finite(temperature_c) {
        Some(temperature_c) => {
            let highest = i32::from(TEMPERATURE_UNKNOWN_CDEGC - 1);
            round_to_i32(temperature_c * 100.0).clamp(i32::from(i16::MIN), highest) as i16
        }
        None => TEMPERATURE_UNKNOWN_CDEGC,
    }
}

/// MAVLink's value for a number with a fraction that is not known: a quiet NaN, always the same bits.
const UNKNOWN_NUMBER: f32 = f32::from_bits(0x7fc0_0000);

/// A number as it is.
pub fn number(value: Option<f32>) -> f32 {
    finite(value).unwrap_or(UNKNOWN_NUMBER)
}

/// MAVLink's value for a number with a fraction that is not known, where a true 0 makes no sense.
pub const NOT_GIVEN: f32 = 0.0;

/// A number above 0; what can't be one is not given.
pub fn number_above_zero(value: Option<f32>) -> f32 {
    finite(value).filter(|value| *value > 0.0).unwrap_or(NOT_GIVEN)
}

/// A charge in Ah, from one in mAh.
pub fn amp_hours(charge_mah: Option<f32>) -> Option<f32> {
    charge_mah.map(|charge_mah| charge_mah / 1000.0)
}

/// MAVLink's value for a remaining charge that is not known.
const REMAINING_UNKNOWN_PCT: i8 = -1;

/// A remaining charge in whole percent, 0 to 100.
pub fn remaining_pct(remaining_pct: Option<f32>) -> i8 {
    match finite(remaining_pct) {
        Some(remaining_pct) => round_to_i32(remaining_pct).clamp(0, 100) as i8,
        None => REMAINING_UNKNOWN_PCT,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    // Requirement: FR-4
    fn a_small_charging_current_is_not_mistaken_for_an_unknown_one() {
        assert_eq!(current_ca(Some(-0.01)), 0);
        assert_eq!(current_ca(Some(-0.02)), -2);
        assert_eq!(current_ca(None), -1);
        assert_eq!(current_ca(Some(f32::NAN)), -1);
        assert_eq!(current_ca(Some(1e9)), 32767);
        assert_eq!(current_ca(Some(-1e9)), -32767);
    }

    #[test]
    // Requirement: FR-3
    fn a_voltage_no_pack_has_is_unknown() {
        for voltage_v in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.1] {
            assert_eq!(voltage_mv(Some(voltage_v)), None, "{voltage_v}");
        }
        assert_eq!(voltage_mv(Some(0.0)), Some(0));
        assert_eq!(voltage_mv(Some(-0.0)), Some(0));
    }

    #[test]
    // Requirement: FR-5
    fn remaining_charge_stays_in_range() {
        assert_eq!(remaining_pct(Some(94.6)), 95);
        assert_eq!(remaining_pct(Some(-3.0)), 0);
        assert_eq!(remaining_pct(Some(250.0)), 100);
        assert_eq!(remaining_pct(None), -1);
    }
}
