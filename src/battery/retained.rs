//! Pack data retained over a restart, in RAM that start-up code leaves alone.

use super::{PACK_WORDS, PackMemory};
use crate::memory::retained::{is_sealed, seal};
use crate::pack::MAX_PACKS;

/// Identifies this layout.
const MAGIC: u32 = u32::from_le_bytes(*b"BAT4");

const HEADER_WORDS: usize = 2;

/// Beside the sequence number: power was off since.
const WAS_OFF: u32 = 1 << 31;

/// With the checksum as the last word.
const RECORD_WORDS: usize = HEADER_WORDS + PACK_WORDS * MAX_PACKS + 1;

/// Two records written alternately: a reset during a write leaves the other one valid.
pub type RetainedMemory = [RetainedRecord; 2];

/// Data of all packs with a sequence number and a checksum, as words.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct RetainedRecord([u32; RECORD_WORDS]);

impl RetainedRecord {
    /// An empty, invalid record.
    pub const BLANK: Self = Self([0; RECORD_WORDS]);

    fn new(sequence: u32, packs: &[PackMemory; MAX_PACKS]) -> Self {
        let mut record = [0; RECORD_WORDS];
        let (header, rest) = record.split_at_mut(HEADER_WORDS);
        header.copy_from_slice(&[MAGIC, sequence & !WAS_OFF]);
        for (words, pack) in rest.chunks_exact_mut(PACK_WORDS).zip(packs) {
            words.copy_from_slice(&pack.to_words());
        }
        seal(&mut record, MAGIC);
        Self(record)
    }

    /// The sequence number, if the record is valid.
    fn sequence(&self) -> Option<u32> {
        let word = self.0.get(1).filter(|_| is_sealed(&self.0, MAGIC));
        word.map(|word| word & !WAS_OFF)
    }

    fn packs(&self) -> [PackMemory; MAX_PACKS] {
        let mut packs = [PackMemory::default(); MAX_PACKS];
        let words = self.0.get(HEADER_WORDS..).unwrap_or(&[]);
        let was_off = self.0.get(1).is_some_and(|word| word & WAS_OFF != 0);
        for (pack, words) in packs.iter_mut().zip(words.as_chunks().0) {
            *pack = PackMemory::from_words(words);
            if was_off {
                pack.lose_power();
            }
        }
        packs
    }
}

/// The data of the newer valid record.
pub fn recall(memory: &RetainedMemory) -> Option<[PackMemory; MAX_PACKS]> {
    newest(memory).map(|(_, record)| record.packs())
}

/// Writes `packs` over the older record.
pub fn retain(memory: &mut RetainedMemory, packs: &[PackMemory; MAX_PACKS]) {
    let (sequence, older) = match newest(memory) {
        Some((0, record)) => (record.sequence().unwrap_or(0).wrapping_add(1), 1),
        Some((_, record)) => (record.sequence().unwrap_or(0).wrapping_add(1), 0),
        None => (0, 0),
    };
    if let Some(record) = memory.get_mut(older) {
        *record = RetainedRecord::new(sequence, packs);
    }
}

/// Power was off: another pack may be connected.
pub fn lose_power(memory: &mut RetainedMemory) {
    for record in memory {
        if let (Some(_), Some(word)) = (record.sequence(), record.0.get_mut(1)) {
            *word |= WAS_OFF;
            seal(&mut record.0, MAGIC);
        }
    }
}

fn newest(memory: &RetainedMemory) -> Option<(usize, &RetainedRecord)> {
    let [first, second] = memory;
    match (first.sequence(), second.sequence()) {
        // Sequence numbers wrap; the two are one apart.
        (Some(a), Some(b)) if b.wrapping_sub(a) & !WAS_OFF == 1 => Some((1, second)),
        (Some(_), _) => Some((0, first)),
        (None, Some(_)) => Some((1, second)),
        (None, None) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::PackSource;
    use proptest::prelude::*;

    /// Packs of which the fourth is read from this source.
    fn used(source: u8) -> [PackMemory; MAX_PACKS] {
        let mut packs = [PackMemory::default(); MAX_PACKS];
        packs[3].source = PackSource([source; 3]);
        packs
    }

    #[test]
    fn latest_record_is_recalled() {
        let mut memory = [RetainedRecord::BLANK; 2];
        assert_eq!(recall(&memory), None);
        for source in [1, 2, 3, 4] {
            retain(&mut memory, &used(source));
            assert_eq!(recall(&memory), Some(used(source)));
        }
    }

    #[test]
    fn torn_write_leaves_the_previous_record() {
        let mut memory = [RetainedRecord::BLANK; 2];
        retain(&mut memory, &used(1));
        retain(&mut memory, &used(2));
        let before = memory;
        retain(&mut memory, &used(3));
        let after = memory;
        let written = (0..2).find(|slot| before[*slot].0 != after[*slot].0).unwrap();
        for words in 1..RECORD_WORDS {
            let mut torn = before;
            torn[written].0[..words].copy_from_slice(&after[written].0[..words]);
            assert_eq!(recall(&torn), Some(used(2)), "after {words} words");
        }
    }

    #[test]
    fn sequence_numbers_wrap() {
        let mut memory = [
            RetainedRecord::new(WAS_OFF - 2, &used(1)),
            RetainedRecord::new(WAS_OFF - 1, &used(2)),
        ];
        for source in [3, 4, 5] {
            retain(&mut memory, &used(source));
            assert_eq!(recall(&memory), Some(used(source)));
        }
    }

    proptest! {
        #[test]
        fn arbitrary_words_are_no_record(words in prop::collection::vec(any::<u32>(), RECORD_WORDS)) {
            let mut record = RetainedRecord::BLANK;
            record.0.copy_from_slice(&words);
            prop_assert!(recall(&[record, record]).is_none());
        }
    }
}
