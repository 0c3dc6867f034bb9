//! Where the sectors of a ring are.

use core::ops::Range;

/// Bytes of a sector, the least that flash erases.
pub const SECTOR_BYTES: u32 = 4096;

/// Sectors that a ring has at most: what is free in 2 MiB of flash.
pub const MAX_SECTORS: u32 = 310;

/// The sectors of a ring.
///
/// Sectors are counted by sequence numbers, which rise by one with each sector that is used; the position in the ring is
/// the remainder of its division by the number of sectors. The first lap begins at the number of sectors, so that the
/// number of a lap before exists.
#[derive(Clone, Copy, Debug)]
pub(super) struct Geometry {
    start: u32,
    sectors: u32,
}

impl Geometry {
    /// The complete sectors of `range`, an address range of a flash.
    pub fn new(range: Range<u32>) -> Self {
        let first = range.start.div_ceil(SECTOR_BYTES);
        let sectors = (range.end / SECTOR_BYTES).saturating_sub(first);
        Self {
            start: first.saturating_mul(SECTOR_BYTES),
            sectors: sectors.min(MAX_SECTORS),
        }
    }

    /// The number of sectors.
    pub fn sectors(&self) -> u32 {
        self.sectors
    }

    /// The sequence number of the first sector that is ever used.
    pub fn first_sequence(&self) -> u32 {
        self.sectors
    }

    /// The position of a sector in the ring.
    pub fn position(&self, sequence: u32) -> u32 {
        sequence.checked_rem(self.sectors).unwrap_or(0)
    }

    /// The address of a sector.
    pub fn address(&self, sequence: u32) -> u32 {
        self.start + self.position(sequence) * SECTOR_BYTES
    }
}
