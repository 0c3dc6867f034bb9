//! Leases in RAM that survives a reset.

use super::address::MAX_CLIENTS;
use crate::memory::retained::{RetainedWords, is_sealed, seal};

/// Identifies this layout.
const MAGIC: u32 = u32::from_le_bytes(*b"DHC1");

/// With the magic number as the first word and the checksum as the last.
const WORDS: usize = size_of::<Holders>() / 4 + 2;

/// Hardware address of the computer that has each address of the pool; zeros where there is none.
pub(super) type Holders = [[u8; 6]; MAX_CLIENTS];

/// Leases, valid behind a checksum: for a static that is not initialised at the start.
pub struct RetainedLeases(RetainedWords<WORDS>);

impl RetainedLeases {
    /// For a static, or to begin without leases.
    pub const fn new() -> Self {
        Self(RetainedWords::new())
    }

    /// The leases before the last reset; none if they are not valid.
    pub(super) fn recall(&self) -> Holders {
        let words = self.0.get();
        let mut holders = Holders::default();
        if is_sealed(&words, MAGIC) {
            let (bytes, _) = holders.as_flattened_mut().as_chunks_mut();
            for (bytes, word) in bytes.iter_mut().zip(words.iter().skip(1)) {
                *bytes = word.to_le_bytes();
            }
        }
        holders
    }

    /// Retains these instead.
    pub(super) fn retain(&self, holders: &Holders) {
        let mut words = [0; WORDS];
        let (bytes, _) = holders.as_flattened().as_chunks();
        for (word, bytes) in words.iter_mut().skip(1).zip(bytes) {
            *word = u32::from_le_bytes(*bytes);
        }
        seal(&mut words, MAGIC);
        self.0.set(words);
    }
}

impl Default for RetainedLeases {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOLDERS: Holders = [
        [2, 0, 0, 0, 0, 1],
        [0; 6],
        [2, 0, 0, 0, 0, 2],
        [0xff; 6],
        [0; 6],
        [0; 6],
        [0; 6],
        [2, 3, 4, 5, 6, 7],
    ];

    #[test]
    fn the_latest_holders_are_recalled() {
        let retained = RetainedLeases::new();
        assert_eq!(retained.recall(), Holders::default());
        for holders in [HOLDERS, Holders::default(), HOLDERS] {
            retained.retain(&holders);
            assert_eq!(retained.recall(), holders);
        }
    }

    #[test]
    fn with_any_flipped_bit_nothing_is_recalled() {
        let retained = RetainedLeases::new();
        retained.retain(&HOLDERS);
        let words = retained.0.get();
        for bit in 0..32 * WORDS {
            let mut damaged = words;
            damaged[bit / 32] ^= 1 << (bit % 32);
            retained.0.set(damaged);
            assert_eq!(retained.recall(), Holders::default(), "bit {bit}");
        }
    }
}
