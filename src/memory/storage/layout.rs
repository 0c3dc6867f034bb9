//! How large the sectors of a region are.

use super::value::Value;

/// How large the sectors of a region are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// A sector is one block, the flash's unit of erase.
    Single,
    /// A sector is two blocks.
    Double,
}

impl Layout {
    /// Blocks of a sector.
    pub const fn blocks(self) -> u32 {
        match self {
            Self::Single => 1,
            Self::Double => 2,
        }
    }

    /// Identifies the layout, and the width of the values, in the headers: what another firmware has stored with another
    /// one is not read.
    pub const fn magic<V: Value>(self) -> u32 {
        let layout = match self {
            Self::Single => b'R',
            Self::Double => b'D',
        };
        u32::from_le_bytes([b'P', b'A', layout, b'0' + V::WORDS])
    }
}
