//! A record as bytes, and the records that a file begins with.

use core::iter::repeat;
use core::mem::take;

use heapless::Vec;

use super::format::{FORMATS, Format, Kind, MULTIPLIERS, UNITS};
use crate::numbers::round_to_i32;

/// The longest record, in bytes: FMT.
pub const MAX_RECORD_BYTES: usize = 89;

/// A record as it is in a file.
pub type RecordBytes = Vec<u8, MAX_RECORD_BYTES>;

/// Begins every record.
pub const SYNCHRONISATION: [u8; 2] = [0xa3, 0x95];

/// Always the same bits for an unknown number.
const UNKNOWN: f32 = f32::from_bits(0x7fc0_0000);

/// A record in the making; its fields follow in their order.
pub struct Packet(RecordBytes);

impl Packet {
    pub fn of(kind: Kind) -> Self {
        let [first, second] = SYNCHRONISATION;
        let mut packet = Self(RecordBytes::new());
        packet.bytes(&[first, second, kind as u8]);
        packet
    }

    /// A record that starts with `TimeUS`, in microseconds since the start.
    pub fn at(kind: Kind, time_us: u64) -> Self {
        let mut packet = Self::of(kind);
        packet.bytes(&time_us.to_le_bytes());
        packet
    }

    // Inlined, this, `number` and `finish` would be repeated for each field of each record.
    #[inline(never)]
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        // Every record fits, as a test proves.
        let _ = self.0.extend_from_slice(bytes);
        self
    }

    pub fn u8(&mut self, value: u8) -> &mut Self {
        self.bytes(&[value])
    }

    pub fn u16(&mut self, value: u16) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub fn u32(&mut self, value: u32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub fn i16(&mut self, value: i16) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub fn i32(&mut self, value: i32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub fn f32(&mut self, value: f32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub fn f64(&mut self, value: f64) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    /// A number that may be unknown.
    #[inline(never)]
    pub fn number(&mut self, value: Option<f32>) -> &mut Self {
        self.f32(finite(value).unwrap_or(UNKNOWN))
    }

    /// A text of `length` bytes: cut there, or filled with zeros.
    pub fn text(&mut self, length: usize, text: &str) -> &mut Self {
        for byte in text.bytes().chain(repeat(0)).take(length) {
            self.u8(byte);
        }
        self
    }

    #[inline(never)]
    pub fn finish(&mut self) -> RecordBytes {
        take(&mut self.0)
    }
}

/// A number that is neither NaN nor infinite.
pub fn finite(value: Option<f32>) -> Option<f32> {
    value.filter(|value| value.is_finite())
}

/// A share in whole percent, 0 to 100.
pub fn whole_pct(pct: f32) -> u8 {
    round_to_i32(pct).clamp(0, 100) as u8
}

/// A file begins with the records of index 0 and following, until there is none: the formats, then units, multipliers, and
/// which of them each format uses. `time_us`: since the start.
pub fn opening_record(index: usize, time_us: u64) -> Option<RecordBytes> {
    if let Some(format) = FORMATS.get(index) {
        return Some(format_record(format));
    }
    let index = index - FORMATS.len();
    if let Some((unit, name)) = UNITS.get(index) {
        let mut packet = Packet::at(Kind::Unit, time_us);
        return Some(packet.u8(*unit).text(64, name).finish());
    }
    let index = index - UNITS.len();
    if let Some((multiplier, value)) = MULTIPLIERS.get(index) {
        let mut packet = Packet::at(Kind::Multiplier, time_us);
        return Some(packet.u8(*multiplier).f64(*value).finish());
    }
    let format = FORMATS.get(index - MULTIPLIERS.len())?;
    Some(format_units_record(format, time_us))
}

fn format_record(format: &Format) -> RecordBytes {
    Packet::of(Kind::Format)
        .u8(format.kind as u8)
        .u8(format.record_bytes() as u8)
        .text(4, format.name)
        .text(16, format.types)
        .text(64, format.columns)
        .finish()
}

fn format_units_record(format: &Format, time_us: u64) -> RecordBytes {
    Packet::at(Kind::FormatUnits, time_us)
        .u8(format.kind as u8)
        .text(16, format.units)
        .text(16, format.multipliers)
        .finish()
}
