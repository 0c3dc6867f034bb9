//! Records and headers in flash: three little-endian words each, the last one their CRC-32.

use crate::crc32::crc32;

/// A stored value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Record {
    pub key: u32,
    pub value: u32,
}

/// Content of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    /// Erased.
    Blank,
    Record(Record),
    /// An interrupted write, or flipped bits.
    Damaged,
}

/// Header of a committed sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// Increases with every sector.
    pub sequence: u32,
}

const SIZE: usize = 12;

impl Record {
    pub const SIZE: usize = SIZE;

    pub fn to_bytes(self) -> [u8; SIZE] {
        seal(self.key, self.value)
    }

    /// Whether `bytes` begin with this key; the CRC is not checked.
    pub fn may_have_key(bytes: &[u8; SIZE], key: u32) -> bool {
        bytes.starts_with(&key.to_le_bytes())
    }
}

impl Slot {
    pub fn from_bytes(bytes: [u8; SIZE]) -> Self {
        if bytes == [0xFF; SIZE] {
            return Self::Blank;
        }
        unseal(bytes).map_or(Self::Damaged, |(key, value)| Self::Record(Record { key, value }))
    }
}

impl Header {
    pub const SIZE: usize = SIZE;

    /// Identifies the layout.
    const MAGIC: u32 = u32::from_le_bytes(*b"PAR1");

    pub fn to_bytes(self) -> [u8; SIZE] {
        seal(Self::MAGIC, self.sequence)
    }

    pub fn from_bytes(bytes: [u8; SIZE]) -> Option<Self> {
        unseal(bytes)
            .filter(|&(magic, _)| magic == Self::MAGIC)
            .map(|(_, sequence)| Self { sequence })
    }
}

fn seal(first: u32, second: u32) -> [u8; SIZE] {
    let words = [first, second, crc32([first, second])];
    let mut bytes = [0; SIZE];
    for (target, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
        *target = word.to_le_bytes();
    }
    bytes
}

fn unseal(bytes: [u8; SIZE]) -> Option<(u32, u32)> {
    let &[first, second, crc] = bytes.as_chunks().0 else {
        return None;
    };
    let (first, second) = (u32::from_le_bytes(first), u32::from_le_bytes(second));
    (crc32([first, second]) == u32::from_le_bytes(crc)).then_some((first, second))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erased_and_zero_bytes_are_no_record_or_header() {
        assert_eq!(Slot::from_bytes([0xFF; SIZE]), Slot::Blank);
        assert_eq!(Slot::from_bytes([0; SIZE]), Slot::Damaged);
        assert_eq!(Header::from_bytes([0xFF; SIZE]), None);
        assert_eq!(Header::from_bytes([0; SIZE]), None);
    }

    #[test]
    fn up_to_three_flipped_bits_are_detected() {
        let bytes = Record {
            key: 7,
            value: 1.5_f32.to_bits(),
        }
        .to_bytes();
        let flip = |mut bytes: [u8; SIZE], bit: usize| {
            bytes[bit / 8] ^= 1 << (bit % 8);
            bytes
        };
        for a in 0..SIZE * 8 {
            assert_eq!(Slot::from_bytes(flip(bytes, a)), Slot::Damaged);
            for b in 0..a {
                assert_eq!(Slot::from_bytes(flip(flip(bytes, a), b)), Slot::Damaged);
                for c in 0..b {
                    assert_eq!(Slot::from_bytes(flip(flip(flip(bytes, a), b), c)), Slot::Damaged);
                }
            }
        }
    }
}
