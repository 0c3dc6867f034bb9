//! What a file begins with.

use super::format::{FORMATS, Format, Kind};
use super::packet::{Packet, RecordBytes};
use super::units::{MULTIPLIERS, UNITS};

/// A file begins with the records of index 0 and following, until there is none: the formats, then units, multipliers, and
/// which of them each format uses. `time_us`: since the start.
pub fn opening_record(index: usize, time_us: u64) -> Option<RecordBytes> {
    if let Some(format) = FORMATS.get(index) {
        return Some(format_record(format));
    }
    let index = index - FORMATS.len();
    if let Some((unit, name)) = UNITS.get(index) {
        let packet = Packet::at(Kind::Unit, time_us).u8(*unit);
        return Some(packet.text::<64>(name).finish());
    }
    let index = index - UNITS.len();
    if let Some((multiplier, value)) = MULTIPLIERS.get(index) {
        let packet = Packet::at(Kind::Multiplier, time_us).u8(*multiplier);
        return Some(packet.f64(*value).finish());
    }
    let format = FORMATS.get(index - MULTIPLIERS.len())?;
    Some(format_units_record(format, time_us))
}

fn format_record(format: &Format) -> RecordBytes {
    Packet::of(Kind::Format)
        .u8(format.kind as u8)
        .u8(format.record_bytes() as u8)
        .text::<4>(format.name)
        .text::<16>(format.types)
        .text::<64>(format.columns)
        .finish()
}

fn format_units_record(format: &Format, time_us: u64) -> RecordBytes {
    Packet::at(Kind::FormatUnits, time_us)
        .u8(format.kind as u8)
        .text::<16>(format.units)
        .text::<16>(format.multipliers)
        .finish()
}
