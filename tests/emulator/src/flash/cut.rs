//! What is left of an erase or a program when the power fails.

use super::super::random::Random;
use super::operation::{Command, FlashOperationKind};

/// At which point of an operation of the flash chip the power fails. Chance, where there is any, is
/// decided by the board's seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashCut {
    /// Before the chip has begun: nothing changes.
    Before,
    /// In its course: the first bytes, at least one, are done; one byte may be done in part; at
    /// least the last one is as it was.
    Prefix,
    /// In its course: bits all over the range have changed, others not. For an erase that includes
    /// ones that read 0 now, as the cells are programmed before they are erased.
    ScatteredBits,
    /// After it, before the processor gets to know.
    After,
}

impl FlashCut {
    /// All of them, for a test that goes through them.
    pub const ALL: [Self; 4] = [Self::Before, Self::Prefix, Self::ScatteredBits, Self::After];

    /// One of those in the course of an operation.
    pub(super) fn torn(random: &mut Random) -> Self {
        [Self::Prefix, Self::ScatteredBits][(random.next_u64() % 2) as usize]
    }

    /// The part of the operation's time after which the power fails.
    pub(super) fn share_of_time(self, random: &mut Random) -> f64 {
        match self {
            Self::Before => 0.0,
            Self::Prefix | Self::ScatteredBits => random.unit(),
            Self::After => 1.0,
        }
    }

    /// What the range holds after the cut.
    pub(super) fn remains(self, command: &Command, before: &[u8], random: &mut Random) -> Vec<u8> {
        let after = command.result(before);
        match self {
            Self::Before => before.to_vec(),
            Self::Prefix => prefix(before, &after, random),
            Self::ScatteredBits if command.kind() == FlashOperationKind::PageProgram => {
                mixed(before, &after, random)
            }
            Self::ScatteredBits => half_erased(before, &after, random),
            Self::After => after,
        }
    }
}

fn prefix(before: &[u8], after: &[u8], random: &mut Random) -> Vec<u8> {
    let torn_byte = 1 + random.next_u64() as usize % (before.len() - 2);
    let mut remains = [&after[..torn_byte], &before[torn_byte..]].concat();
    remains[torn_byte] = mix(before[torn_byte], after[torn_byte], random.next_u64() as u8);
    remains
}

/// An erase programs all cells to 0 first, so that none is erased too far, and makes them 1 then.
/// It is in either half that the power fails.
fn half_erased(before: &[u8], after: &[u8], random: &mut Random) -> Vec<u8> {
    let zeros = vec![0; before.len()];
    if random.next_u64().is_multiple_of(2) {
        mixed(before, &zeros, random)
    } else {
        mixed(&zeros, after, random)
    }
}

/// Every bit from one or the other. How far the operation has come, the share of bits from
/// `after`, is drawn, too.
fn mixed(before: &[u8], after: &[u8], random: &mut Random) -> Vec<u8> {
    let progress = random.unit();
    let mut mask = || (0..8).fold(0, |mask, bit| mask | u8::from(random.unit() < progress) << bit);
    before
        .iter()
        .zip(after)
        .map(|(&old, &new)| mix(old, new, mask()))
        .collect()
}

/// The bits of `mask` from `new`, the others from `old`.
fn mix(old: u8, new: u8, mask: u8) -> u8 {
    old & !mask | new & mask
}
