//! Positions of a ring's sectors, and sets of them.

use core::ops::Range;

use crate::memory::flash_map;

/// Bytes of a sector, the least that flash erases.
pub const SECTOR_BYTES: u32 = 4096;

/// Sectors that a ring has at most: those of a board's log.
pub const MAX_SECTORS: u32 = (flash_map::LOG.end - flash_map::LOG.start) / SECTOR_BYTES;

/// The sectors of a ring.
///
/// Sectors are counted by sequence numbers, which rise by one with each sector that is used; the position in the ring is
/// the remainder of its division by the number of sectors. The first lap begins at the number of sectors, so that the
/// number of a lap before exists.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
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

const WORDS: usize = MAX_SECTORS.div_ceil(u32::BITS) as usize;

/// A set of positions in a ring.
#[derive(Clone, Debug, Default)]
pub struct SectorSet([u32; WORDS]);

impl SectorSet {
    /// Adds a position below [`MAX_SECTORS`].
    pub fn insert(&mut self, position: u32) {
        if let Some((word, bit)) = self.place(position) {
            *word |= bit;
        }
    }

    /// Removes a position.
    pub fn remove(&mut self, position: u32) {
        if let Some((word, bit)) = self.place(position) {
            *word &= !bit;
        }
    }

    /// Whether it has this position.
    pub fn contains(&self, position: u32) -> bool {
        let word = self.0.get((position / u32::BITS) as usize);
        word.is_some_and(|word| word & bit_of(position) != 0)
    }

    /// Number of its positions.
    pub fn count(&self) -> u32 {
        self.0.iter().map(|word| word.count_ones()).sum()
    }

    fn place(&mut self, position: u32) -> Option<(&mut u32, u32)> {
        let word = self.0.get_mut((position / u32::BITS) as usize)?;
        Some((word, bit_of(position)))
    }
}

fn bit_of(position: u32) -> u32 {
    1 << (position % u32::BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_what_was_inserted_and_not_removed() {
        let mut set = SectorSet::default();
        (0..MAX_SECTORS).for_each(|position| set.insert(position));
        (0..MAX_SECTORS)
            .step_by(3)
            .for_each(|position| set.remove(position));
        assert_eq!(set.count(), MAX_SECTORS - MAX_SECTORS.div_ceil(3));
        assert!((0..MAX_SECTORS).all(|position| set.contains(position) == (position % 3 != 0)));
    }
}
