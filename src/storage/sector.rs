//! The sectors of a region.

use super::value::Value;

/// How large the sectors of a region are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// A sector is one block, the flash's unit of erase.
    Single,
    /// A sector is two blocks.
    Double,
}

/// A sector of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sector {
    pub layout: Layout,
    /// Counted from the start of the region, in sectors of this layout.
    pub index: u32,
}

impl Layout {
    /// Blocks of a sector.
    pub const fn blocks(self) -> u32 {
        match self {
            Self::Single => 1,
            Self::Double => 2,
        }
    }

    /// Identifies the layout, and the width of the values, in the headers.
    pub const fn magic<V: Value>(self) -> u32 {
        let layout = match self {
            Self::Single => b'R',
            Self::Double => b'D',
        };
        u32::from_le_bytes([b'P', b'A', layout, b'0' + V::WORDS])
    }

    /// The layout of an earlier version, from which the values are taken over.
    pub const fn earlier(self) -> Option<Self> {
        match self {
            Self::Single => None,
            Self::Double => Some(Self::Single),
        }
    }
}

impl Sector {
    /// The sector of `layout` in which this one begins.
    pub const fn within(self, layout: Layout) -> Self {
        Self {
            layout,
            index: self.first_block() / layout.blocks(),
        }
    }

    /// Its first block, counted from the start of the region.
    pub const fn first_block(self) -> u32 {
        self.index * self.layout.blocks()
    }
}
