//! BATTERY_STATUS of another component: MAVLink's sentinels become `None`.

use core::array;

use super::{Request, Target};
use crate::battery::{CellVoltages, MAX_CELLS};
use crate::mavlink::payload::Payload;
use crate::pack::Pack;
use crate::sensor::ExternalReading;

/// Fields of `voltages`; those of `voltages_ext` follow after other fields.
const CELLS: usize = 10;

const CURRENT_CONSUMED: usize = 0;
const ENERGY_CONSUMED: usize = 4;
const TEMPERATURE: usize = 8;
const VOLTAGES: usize = 10;
const CURRENT_BATTERY: usize = 30;
const ID: usize = 32;
const BATTERY_REMAINING: usize = 35;
const VOLTAGES_EXT: usize = 41;

const VOLTAGE_UNKNOWN_MV: u16 = u16::MAX;
const TEMPERATURE_UNKNOWN_CDEGC: i16 = i16::MAX;
const CURRENT_UNKNOWN_CA: i16 = -1;

/// A cell has no more, in millivolts: what is above is the voltage of several.
const HIGHEST_CELL_MV: u16 = 5_000;

const WATT_HOURS_PER_HECTOJOULE: f32 = 1.0 / 36.0;

type CellFields = [u16; MAX_CELLS];

/// `None` if there is no such pack, or if its voltage is unknown: a component whose sensor has failed is no source.
pub(super) fn battery_status(payload: &Payload<'_>) -> Option<(Target, Request)> {
    let pack = Pack::from_instance(payload.u8(ID))?;
    let fields = cell_fields(payload);
    let known = known_fields(&fields)?;
    let current_ca = payload.i16(CURRENT_BATTERY);
    let temperature_cdegc = payload.i16(TEMPERATURE);
    let reading = ExternalReading {
        pack,
        voltage_v: sum_v(known),
        cells: cells(known),
        current_a: (current_ca != CURRENT_UNKNOWN_CA).then(|| f32::from(current_ca) * 0.01),
        consumed_mah: amount(payload.i32(CURRENT_CONSUMED)),
        consumed_wh: amount(payload.i32(ENERGY_CONSUMED)).map(|hj| hj * WATT_HOURS_PER_HECTOJOULE),
        state_of_charge: share(payload.u8(BATTERY_REMAINING)),
        temperature_c: (temperature_cdegc != TEMPERATURE_UNKNOWN_CDEGC)
            .then(|| f32::from(temperature_cdegc) * 0.01),
    };
    Some((Target::Everyone, Request::PackReading(reading)))
}

fn cell_fields(payload: &Payload<'_>) -> CellFields {
    array::from_fn(|cell| match cell.checked_sub(CELLS) {
        None => payload.u16(VOLTAGES + 2 * cell),
        Some(cell) => payload.u16(VOLTAGES_EXT + 2 * cell),
    })
}

/// The fields up to the first unknown one. `None` if that is the first of all, or if others are known behind it: their sum is
/// not the pack's voltage.
fn known_fields(fields: &CellFields) -> Option<&[u16]> {
    let is_unknown = |mv: &u16| *mv == VOLTAGE_UNKNOWN_MV;
    let end = fields.iter().position(is_unknown).unwrap_or(MAX_CELLS);
    let (known, rest) = fields.split_at_checked(end)?;
    // 0 is an unused field of `voltages_ext`.
    let is_whole = rest.iter().all(|mv| is_unknown(mv) || *mv == 0);
    (is_whole && !known.is_empty()).then_some(known)
}

/// The sum of the fields, whether each is a cell or they are one voltage. 0 V is a pack that is not connected.
fn sum_v(known: &[u16]) -> f32 {
    let sum_mv: u32 = known.iter().copied().map(u32::from).sum();
    sum_mv as f32 * 1e-3
}

/// Fields are cells if there are several, and none has more than a cell can have. Zeros at the end are unused fields.
fn cells(known: &[u16]) -> CellVoltages {
    let count = known.iter().rposition(|mv| *mv > 0).map_or(0, |last| last + 1);
    let used = known.get(..count).unwrap_or_default();
    let are_cells = count > 1 && used.iter().all(|mv| *mv <= HIGHEST_CELL_MV);
    CellVoltages::from_millivolts(if are_cells { used } else { &[] })
}

/// −1 is unknown, and no other negative number is an amount.
fn amount(field: i32) -> Option<f32> {
    (field >= 0).then_some(field as f32)
}

/// 0 to 100 %. −1, here 255, is unknown, and nothing else is a percentage.
fn share(percent: u8) -> Option<f32> {
    (percent <= 100).then(|| f32::from(percent) * 0.01)
}
