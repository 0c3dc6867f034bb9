//! ArduPilot's format of packed parameters.
//!
//! A header of three 16-bit numbers: a magic number, how many parameters follow, how many there are. In a file that is
//! uploaded the last one is the file's length. A record for each parameter: its type (low four bits) and whether its default
//! follows (bit 4); how many characters its name has in common with the one before (low four bits) and how many others less
//! one (high four bits); those others; the value, and its default.

use heapless::Vec;

use crate::parameter::{Kind, MAX_NAME_LENGTH};

/// Bytes of the header.
pub(super) const HEADER_BYTES: usize = 6;

pub(super) const MAGIC: u16 = 0x671b;

/// The magic number of a file with defaults.
pub(super) const MAGIC_WITH_DEFAULTS: u16 = 0x671c;

/// The flag of a record whose default follows.
pub(super) const HAS_DEFAULT: u8 = 1 << 4;

/// The longest value.
pub(super) const MAX_VALUE_BYTES: usize = 4;

/// The longest name in a record, and both bytes before it.
pub(super) const MAX_HEAD_BYTES: usize = 2 + MAX_NAME_LENGTH;

/// A type in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PackedType(pub Kind);

impl PackedType {
    pub fn from_number(number: u8) -> Option<Self> {
        let kind = match number {
            1 => Kind::Int8,
            2 => Kind::Int16,
            3 => Kind::Int32,
            4 => Kind::Real32,
            _ => return None,
        };
        Some(Self(kind))
    }

    pub fn number(self) -> u8 {
        match self.0 {
            Kind::Int8 => 1,
            Kind::Int16 => 2,
            Kind::Int32 => 3,
            Kind::Real32 => 4,
        }
    }

    /// Bytes of a value.
    pub fn value_bytes(self) -> usize {
        match self.0 {
            Kind::Int8 => 1,
            Kind::Int16 => 2,
            Kind::Int32 | Kind::Real32 => MAX_VALUE_BYTES,
        }
    }

    /// A value's bytes in the file.
    pub fn pack(self, value: f32) -> Vec<u8, MAX_VALUE_BYTES> {
        let mut bytes = Vec::new();
        // Each fits.
        let _ = match self.0 {
            Kind::Int8 => bytes.extend_from_slice(&(value as i8).to_le_bytes()),
            Kind::Int16 => bytes.extend_from_slice(&(value as i16).to_le_bytes()),
            Kind::Int32 => bytes.extend_from_slice(&(value as i32).to_le_bytes()),
            Kind::Real32 => bytes.extend_from_slice(&value.to_le_bytes()),
        };
        bytes
    }

    /// The value of these bytes; missing ones are 0.
    pub fn unpack(self, bytes: &[u8]) -> f32 {
        let [a, b, c, d]: [u8; MAX_VALUE_BYTES] =
            core::array::from_fn(|place| bytes.get(place).copied().unwrap_or(0));
        match self.0 {
            Kind::Int8 => f32::from(i8::from_le_bytes([a])),
            Kind::Int16 => f32::from(i16::from_le_bytes([a, b])),
            Kind::Int32 => i32::from_le_bytes([a, b, c, d]) as f32,
            Kind::Real32 => f32::from_le_bytes([a, b, c, d]),
        }
    }
}
