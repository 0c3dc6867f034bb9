//! What survives a reset of the processor: a record in RAM that no start-up code touches.

use super::MAX_PACKS;
use super::charge::StateOfCharge;
use super::consumption::Consumption;
use crate::sealed::{is_sealed, seal};

/// Tells this layout from others, and from what RAM holds when power comes on.
const MAGIC: u32 = u32::from_le_bytes(*b"BAT1");

const HEADER_WORDS: usize = 2;
const PACK_WORDS: usize = 8;
/// The last one is the checksum.
const RECORD_WORDS: usize = HEADER_WORDS + PACK_WORDS * MAX_PACKS + 1;

/// Two records that are written by turns, so that a reset in the middle of a write leaves the other one.
pub type RetainedMemory = [RetainedRecord; 2];

/// What was known of the packs, with a sequence number and a checksum, as plain words.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct RetainedRecord([u32; RECORD_WORDS]);

/// What was known of one pack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackMemory {
    pub(super) consumption: Consumption,
    pub(super) charge: Option<StateOfCharge>,
    pub(super) detected_cells: Option<u8>,
}

impl RetainedRecord {
    /// A record of nothing.
    pub const BLANK: Self = Self([0; RECORD_WORDS]);

    fn new(sequence: u32, packs: &[PackMemory; MAX_PACKS]) -> Self {
        let mut record = [0; RECORD_WORDS];
        let (header, rest) = record.split_at_mut(HEADER_WORDS);
        header.copy_from_slice(&[MAGIC, sequence]);
        for (words, pack) in rest.chunks_exact_mut(PACK_WORDS).zip(packs) {
            words.copy_from_slice(&pack.to_words());
        }
        seal(&mut record, MAGIC);
        Self(record)
    }

    /// The sequence number, if the record is whole.
    fn sequence(&self) -> Option<u32> {
        self.0.get(1).copied().filter(|_| is_sealed(&self.0, MAGIC))
    }

    fn packs(&self) -> [PackMemory; MAX_PACKS] {
        let mut packs = [PackMemory::default(); MAX_PACKS];
        let words = self.0.get(HEADER_WORDS..).unwrap_or(&[]);
        for (pack, words) in packs.iter_mut().zip(words.as_chunks().0) {
            *pack = PackMemory::from_words(words);
        }
        packs
    }
}

/// What the newer of the whole records tells, if there is one.
pub fn recall(memory: &RetainedMemory) -> Option<[PackMemory; MAX_PACKS]> {
    newest(memory).map(|(_, record)| record.packs())
}

/// Writes what is known into the older record.
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

fn newest(memory: &RetainedMemory) -> Option<(usize, &RetainedRecord)> {
    let [first, second] = memory;
    match (first.sequence(), second.sequence()) {
        // Sequence numbers wrap; the two are one apart.
        (Some(a), Some(b)) if b.wrapping_sub(a) == 1 => Some((1, second)),
        (Some(_), _) => Some((0, first)),
        (None, Some(_)) => Some((1, second)),
        (None, None) => None,
    }
}

const KNOWS_CHARGE: u32 = 1 << 8;
const CELLS: u32 = 0xFF;

impl PackMemory {
    fn to_words(self) -> [u32; PACK_WORDS] {
        let [charge_low, charge_high, energy_low, energy_high] = self.consumption.to_words();
        let [value, low, high] = self.charge.map_or([0; 3], |charge| charge.to_words());
        let knows_charge = if self.charge.is_some() { KNOWS_CHARGE } else { 0 };
        let flags = u32::from(self.detected_cells.unwrap_or(0)) | knows_charge;
        [
            charge_low,
            charge_high,
            energy_low,
            energy_high,
            value,
            low,
            high,
            flags,
        ]
    }

    fn from_words(words: &[u32; PACK_WORDS]) -> Self {
        let &[
            charge_low,
            charge_high,
            energy_low,
            energy_high,
            value,
            low,
            high,
            flags,
        ] = words;
        let cells = (flags & CELLS) as u8;
        Self {
            consumption: Consumption::from_words([charge_low, charge_high, energy_low, energy_high]),
            charge: (flags & KNOWS_CHARGE != 0)
                .then(|| StateOfCharge::from_words([value, low, high]))
                .flatten(),
            detected_cells: (cells > 0).then_some(cells),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::Consumed;
    use proptest::prelude::*;

    fn used(charge_mah: f32) -> [PackMemory; MAX_PACKS] {
        let mut packs = [PackMemory::default(); MAX_PACKS];
        packs[3].consumption.restart(Consumed {
            charge_mah,
            energy_wh: -2.5,
        });
        packs[3].charge = Some(StateOfCharge::told(0.625));
        packs[3].detected_cells = Some(3);
        packs
    }

    #[test]
    fn what_was_retained_is_recalled_and_the_latest_of_it() {
        let mut memory = [RetainedRecord::BLANK; 2];
        assert_eq!(recall(&memory), None);
        for charge_mah in [1.0, 2.0, 3.0, 4.0] {
            retain(&mut memory, &used(charge_mah));
            assert_eq!(recall(&memory), Some(used(charge_mah)));
        }
    }

    #[test]
    fn a_record_that_was_not_finished_leaves_the_one_before() {
        let mut memory = [RetainedRecord::BLANK; 2];
        retain(&mut memory, &used(1.0));
        retain(&mut memory, &used(2.0));
        let before = memory;
        retain(&mut memory, &used(3.0));
        let after = memory;
        let written = (0..2).find(|slot| before[*slot].0 != after[*slot].0).unwrap();
        for words in 1..RECORD_WORDS {
            let mut torn = before;
            torn[written].0[..words].copy_from_slice(&after[written].0[..words]);
            assert_eq!(recall(&torn), Some(used(2.0)), "after {words} words");
        }
    }

    #[test]
    fn sequence_numbers_may_wrap() {
        let mut memory = [
            RetainedRecord::new(u32::MAX - 1, &used(1.0)),
            RetainedRecord::new(u32::MAX, &used(2.0)),
        ];
        for charge_mah in [3.0, 4.0, 5.0] {
            retain(&mut memory, &used(charge_mah));
            assert_eq!(recall(&memory), Some(used(charge_mah)));
        }
    }

    proptest! {
        #[test]
        fn what_ram_happens_to_hold_is_never_taken_for_a_record(words in prop::collection::vec(any::<u32>(), RECORD_WORDS)) {
            let mut record = RetainedRecord::BLANK;
            record.0.copy_from_slice(&words);
            prop_assert!(recall(&[record, record]).is_none());
        }
    }
}
