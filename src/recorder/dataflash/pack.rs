//! Records of a pack: BAT, what is measured of it; BATX, what is estimated of it, for which ArduPilot has no field; BCL and
//! BCL2, measured voltages of its cells.

use core::ops::Range;

use super::format::Kind;
use super::packet::{Packet, RecordBytes, finite, whole_pct};
use crate::battery::{Amount, BatteryState, MAX_CELLS, PackStatus};
use crate::numbers::round_to_i32;
use crate::pack::Pack;

/// A temperature that is unknown, as in ArduPilot.
const TEMPERATURE_UNKNOWN_CDEGC: i16 = 0;

/// A remaining charge that is unknown, as in ArduPilot.
const REMAINING_UNKNOWN_PCT: u8 = u8::MAX;

/// A state of health that is unknown, as in ArduPilot.
const STATE_OF_HEALTH_UNKNOWN_PCT: u8 = 0;

/// `Volt` is the terminal voltage, whichever is reported to ground stations. The charge of a tank is in millilitres.
pub(super) fn encode_battery(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
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

/// Standard deviations between the estimate and each of its bounds: the truth is within them 19 times of 20.
const DEVIATIONS: f32 = 2.0;

/// `SoC` with its bounds and `Use`, the usable share, in percent; `Cap`, the learnt capacity, in milliampere-hours; `State`
/// and `Flt` by MAVLink's numbers and bits; `FS` by ArduPilot's; `Stat`, see [`status_number`].
pub(super) fn encode_estimate(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let remaining_pct = finite(state.remaining_pct);
    let deviation_pct = finite(state.remaining_sigma_pct).map(|sigma_pct| DEVIATIONS * sigma_pct);
    let bounds = remaining_pct.zip(deviation_pct);
    Packet::at(Kind::Estimate, time_us)
        .u8(pack.instance())
        .number(remaining_pct)
        .number(bounds.map(|(pct, deviation_pct)| (pct - deviation_pct).max(0.0)))
        .number(bounds.map(|(pct, deviation_pct)| (pct + deviation_pct).min(100.0)))
        .number(state.usable_pct)
        .number(state.learnt_capacity_mah)
        .u8(state.charge_state as u8)
        .u16(state.faults_to_show().bits())
        .u8(state.failsafe as u8)
        .u8(status_number(state.status))
        .finish()
}

/// Numbers of the field `Stat`. They stay as they are: files are kept.
fn status_number(status: PackStatus) -> u8 {
    match status {
        PackStatus::Disabled => 0,
        PackStatus::Unknown => 1,
        PackStatus::NotConnected => 2,
        PackStatus::Healthy => 3,
        PackStatus::Unhealthy => 4,
    }
}

/// Cells in BCL; BCL2 has those that follow.
pub(super) const FIRST_CELLS: usize = 12;

/// A cell that does not exist, as in ArduPilot.
const NO_CELL_MV: u16 = 0;

pub(super) fn encode_cells(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let packet = Packet::at(Kind::Cells, time_us)
        .u8(pack.instance())
        .number(state.voltage_v);
    with_cells(packet, state, 0..FIRST_CELLS)
}

pub(super) fn encode_more_cells(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let packet = Packet::at(Kind::MoreCells, time_us).u8(pack.instance());
    with_cells(packet, state, FIRST_CELLS..MAX_CELLS)
}

/// Voltages as they are, where ArduPilot adds 1 mV. A cell at 0 V is recorded as 1 mV, since 0 is not a cell.
fn with_cells(packet: Packet, state: &BatteryState, places: Range<usize>) -> RecordBytes {
    let measured = state.cells.millivolts();
    let cells = places.map(|place| {
        measured
            .get(place)
            .map_or(NO_CELL_MV, |cell_mv| (*cell_mv).max(1))
    });
    cells.fold(packet, Packet::u16).finish()
}
