//! Facts of a pack that more than one message reports, and that do not change in use.

use core::iter;

use ::mavlink::types::CharArray;
use heapless::String;

use crate::battery::{Amount, BatteryState, ChargeSource, Chemistry, Contents, Date, PackDetails};
use crate::mavlink::dialect::MavBatteryType;
use crate::numbers::text;

/// MAVLink's value for a number of charges that is not known, `UINT16_MAX`.
const CYCLE_COUNT_UNKNOWN: u16 = u16::MAX;

/// MAVLink's value for a number of cells that is not known.
const CELLS_UNKNOWN: u8 = 0;

/// MAVLink's value for a weight that is not known.
pub const WEIGHT_UNKNOWN_G: u16 = 0;

/// Between the maker's name and the product's.
const NAME_SEPARATOR: u8 = b'_';

/// The longest number an `i32` can be, in characters.
const NUMBER_BYTES: usize = 11;

/// A day, in characters: 30/06/2026.
const DATE_BYTES: usize = 10;

/// Chemistry of the cells, as set or as the pack reports; that is known even while nothing is measured. A tank has none.
pub fn battery_type(battery: &BatteryState) -> MavBatteryType {
    if battery.contents == Contents::Fuel {
        return MavBatteryType::MAV_BATTERY_TYPE_UNKNOWN;
    }
    match battery.chemistry {
        Chemistry::LiPo => MavBatteryType::MAV_BATTERY_TYPE_LIPO,
        Chemistry::LiFe => MavBatteryType::MAV_BATTERY_TYPE_LIFE,
        Chemistry::LiIon => MavBatteryType::MAV_BATTERY_TYPE_LION,
        Chemistry::NiMh => MavBatteryType::MAV_BATTERY_TYPE_NIMH,
    }
}

/// The voltage of a charged cell, in volts; a tank has no cells.
pub fn charged_cell_voltage_v(battery: &BatteryState) -> Option<f32> {
    match battery.contents {
        Contents::Charge => battery.chemistry.charged_cell_voltage_v(),
        Contents::Fuel => None,
    }
}

/// Lowest voltage of a cell: the owner's critical threshold, since no pack reports it.
pub fn lowest_cell_voltage_v(battery: &BatteryState) -> Option<f32> {
    let cells = battery.cell_count.filter(|cells| *cells > 0)?;
    Some(battery.critical_voltage_v? / f32::from(cells))
}

/// The pack's nominal voltage, in volts: its own, else that of its cells.
pub fn nominal_voltage_v(battery: &BatteryState) -> Option<f32> {
    let of_cells = |cells| battery.chemistry.nominal_cell_voltage_v() * f32::from(cells);
    battery
        .details
        .design_voltage_v
        .or(battery.cell_count.map(of_cells))
}

/// The charge of the pack when it was new, in milliampere-hours: its own, else what the owner has set. Of a tank, its volume
/// in millilitres.
pub fn design_capacity(battery: &BatteryState) -> Option<f32> {
    battery
        .details
        .design_capacity_mah
        .or(match battery.charge_source {
            ChargeSource::Estimated | ChargeSource::Reported => battery.capacity.map(Amount::number),
            ChargeSource::Gauge => None,
        })
}

/// The charge of the full pack at its present age, in milliampere-hours: by its gauge, else as learnt. Of a tank, its volume in
/// millilitres.
pub fn full_capacity(battery: &BatteryState) -> Option<f32> {
    match battery.charge_source {
        ChargeSource::Gauge => battery.capacity.map(Amount::number),
        ChargeSource::Estimated | ChargeSource::Reported => battery.learnt_capacity_mah,
    }
}

pub fn cycle_count(details: &PackDetails) -> u16 {
    details.cycle_count.unwrap_or(CYCLE_COUNT_UNKNOWN)
}

pub fn cells_in_series(battery: &BatteryState) -> u8 {
    battery.cell_count.unwrap_or(CELLS_UNKNOWN)
}

/// The serial number in decimal.
pub fn serial_number<const N: usize>(battery: &BatteryState) -> CharArray<N> {
    let digits: Option<String<NUMBER_BYTES>> =
        battery.serial_number.map(|number| text(format_args!("{number}")));
    characters(digits.unwrap_or_default().bytes())
}

/// The maker's name and the product's, or the one that is known.
pub fn name<const N: usize>(details: &PackDetails) -> CharArray<N> {
    let (maker, product) = (&details.manufacturer, &details.device);
    let are_both_known = !maker.is_empty() && !product.is_empty();
    let separator = iter::once(NAME_SEPARATOR).filter(|_| are_both_known);
    let maker = maker.as_bytes().iter().copied();
    characters(maker.chain(separator).chain(product.as_bytes().iter().copied()))
}

/// The day the pack was made, with `separator` between day, month and year.
pub fn manufacture_date<const N: usize>(details: &PackDetails, separator: &str) -> CharArray<N> {
    let digits =
        |Date { year, month, day }| text(format_args!("{day:02}{separator}{month:02}{separator}{year:04}"));
    let digits: Option<String<DATE_BYTES>> = details.manufactured.filter(is_day).map(digits);
    characters(digits.unwrap_or_default().bytes())
}

fn is_day(date: &Date) -> bool {
    date.year <= 9999 && (1..=12).contains(&date.month) && (1..=31).contains(&date.day)
}

/// As many of these characters as fit before a 0, which ends every text.
fn characters<const N: usize>(text: impl Iterator<Item = u8>) -> CharArray<N> {
    let mut bytes = [0; N];
    for (to, from) in bytes.iter_mut().take(N.saturating_sub(1)).zip(text) {
        *to = from;
    }
    CharArray::new(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_always_ends_with_a_zero() {
        assert_eq!(*characters::<4>(b"abcdef".iter().copied()), *b"abc\0");
        assert_eq!(*characters::<4>(b"ab".iter().copied()), *b"ab\0\0");
    }

    #[test]
    fn the_longest_serial_number_fits() {
        let battery = BatteryState {
            serial_number: Some(i32::MIN),
            ..BatteryState::default()
        };
        assert_eq!(serial_number::<16>(&battery).to_str(), Ok("-2147483648"));
    }
}
