//! Records and headers in flash: little-endian words, the last one their CRC-32.

use core::iter;

use super::value::Value;
use crate::memory::checksum::crc32;

/// A stored value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Record<V> {
    pub key: u32,
    pub value: V,
}

/// Content of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot<V> {
    /// Erased.
    Blank,
    Record(Record<V>),
    /// An interrupted write, or flipped bits.
    Damaged,
}

/// Header of a committed sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// Increases with every sector.
    pub sequence: u32,
}

impl<V: Value> Record<V> {
    pub const SIZE: usize = size_of::<V::Record>();

    /// Key, value and CRC-32.
    pub fn to_bytes(self) -> V::Record {
        let content = || iter::once(self.key).chain(self.value.words().iter().copied());
        let mut bytes = V::ERASED;
        let words = content().chain(iter::once(crc32(content())));
        for (place, word) in bytes.as_mut().as_chunks_mut().0.iter_mut().zip(words) {
            *place = word.to_le_bytes();
        }
        bytes
    }

    /// The record of which these are the bytes, if its CRC is right.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut words = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
        let key = words.next()?;
        let mut value = V::default();
        for (place, word) in value.words_mut().iter_mut().zip(&mut words) {
            *place = word;
        }
        let crc = crc32(iter::once(key).chain(value.words().iter().copied()));
        (words.next() == Some(crc)).then_some(Self { key, value })
    }

    /// Whether `bytes` begin with this key; the CRC is not checked.
    pub fn may_have_key(bytes: &[u8], key: u32) -> bool {
        bytes.starts_with(&key.to_le_bytes())
    }
}

impl<V: Value> Slot<V> {
    pub fn from_bytes(bytes: &V::Record) -> Self {
        if *bytes == V::ERASED {
            return Self::Blank;
        }
        Record::from_bytes(bytes.as_ref()).map_or(Self::Damaged, Self::Record)
    }
}

impl Header {
    pub const SIZE: usize = Record::<u32>::SIZE;

    /// `magic` identifies the layout.
    pub fn to_bytes(self, magic: u32) -> <u32 as Value>::Record {
        let record = Record {
            key: magic,
            value: self.sequence,
        };
        record.to_bytes()
    }

    pub fn from_bytes(bytes: &<u32 as Value>::Record, magic: u32) -> Option<Self> {
        Record::<u32>::from_bytes(bytes)
            .filter(|record| record.key == magic)
            .map(|record| Self {
                sequence: record.value,
            })
    }
}

#[cfg(test)]
mod tests {
    use super::super::region::Layout;
    use super::*;

    const SIZE: usize = Record::<u32>::SIZE;
    const MAGIC: u32 = Layout::Single.magic::<u32>();

    fn slot(bytes: [u8; SIZE]) -> Slot<u32> {
        Slot::from_bytes(&bytes)
    }

    #[test]
    fn erased_and_zero_bytes_are_no_record_or_header() {
        assert_eq!(slot([0xFF; SIZE]), Slot::Blank);
        assert_eq!(slot([0; SIZE]), Slot::Damaged);
        assert_eq!(Header::from_bytes(&[0xFF; SIZE], MAGIC), None);
        assert_eq!(Header::from_bytes(&[0; SIZE], MAGIC), None);
        assert_eq!(Slot::<[u32; 14]>::from_bytes(&[0xFF; 64]), Slot::Blank);
        assert_eq!(Slot::<[u32; 14]>::from_bytes(&[0; 64]), Slot::Damaged);
    }

    #[test]
    fn bytes_are_as_documented() {
        // CRCs by `zlib.crc32`.
        let record = Record {
            key: 66,
            value: 4.1_f32.to_bits(),
        };
        assert_eq!(
            record.to_bytes(),
            [0x42, 0, 0, 0, 0x33, 0x33, 0x83, 0x40, 0x67, 0x9c, 0x5b, 0xac]
        );
        let header = Header { sequence: 7 };
        assert_eq!(
            header.to_bytes(MAGIC),
            [b'P', b'A', b'R', b'1', 7, 0, 0, 0, 0x11, 0x52, 0xa8, 0x92]
        );
        assert_eq!(
            header.to_bytes(Layout::Double.magic::<u32>()),
            [b'P', b'A', b'D', b'1', 7, 0, 0, 0, 0x97, 0xb3, 0x27, 0x47]
        );
    }

    #[test]
    fn header_of_another_width_or_layout_is_none() {
        let other_width = Layout::Single.magic::<[u32; 14]>();
        let other_layout = Layout::Double.magic::<u32>();
        for magic in [other_width, other_layout] {
            let bytes = Header { sequence: 7 }.to_bytes(magic);
            assert_eq!(Header::from_bytes(&bytes, MAGIC), None);
            assert_eq!(Header::from_bytes(&bytes, magic), Some(Header { sequence: 7 }));
        }
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
            assert_eq!(slot(flip(bytes, a)), Slot::Damaged);
            for b in 0..a {
                assert_eq!(slot(flip(flip(bytes, a), b)), Slot::Damaged);
                for c in 0..b {
                    assert_eq!(slot(flip(flip(flip(bytes, a), b), c)), Slot::Damaged);
                }
            }
        }
    }

    #[test]
    fn two_flipped_bits_of_a_wide_record_are_detected() {
        let record = Record::<[u32; 14]> {
            key: 7,
            value: core::array::from_fn(|word| word as u32),
        };
        let flip = |mut bytes: [u8; 64], bit: usize| {
            bytes[bit / 8] ^= 1 << (bit % 8);
            bytes
        };
        let bytes = record.to_bytes();
        assert_eq!(Slot::from_bytes(&bytes), Slot::Record(record));
        for a in 0..64 * 8 {
            assert_eq!(Slot::<[u32; 14]>::from_bytes(&flip(bytes, a)), Slot::Damaged);
            for b in 0..a {
                assert_eq!(
                    Slot::<[u32; 14]>::from_bytes(&flip(flip(bytes, a), b)),
                    Slot::Damaged
                );
            }
        }
    }
}
