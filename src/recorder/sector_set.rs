//! A set of sectors, a bit each.

use super::geometry::MAX_SECTORS;

const WORDS: usize = MAX_SECTORS.div_ceil(u32::BITS) as usize;

/// A set of positions in a ring.
#[derive(Clone, Debug, Default)]
pub(super) struct SectorSet([u32; WORDS]);

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

    /// How many positions it has.
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
