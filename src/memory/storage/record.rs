//! Records and headers in flash: little-endian words, the last one their CRC-32.

use core::iter;

use crate::memory::checksum::crc32;

/// Words of the widest value.
pub(super) const MAX_WORDS: usize = 34;

/// A stored value as in flash: key, value and CRC-32. It is read into: copies made a move to the next sector an eighth longer.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoredRecord {
    bytes: [u8; Self::size(MAX_WORDS)],
    size: usize,
}

/// Content of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    /// Erased.
    Blank,
    Record,
    /// An interrupted write, or flipped bits.
    Damaged,
}

impl StoredRecord {
    /// Bytes of a record with a value of so many words.
    pub const fn size(words: usize) -> usize {
        (words + 2) * size_of::<u32>()
    }

    /// One with its CRC. A value that is too wide, which no [`Value`](super::Value) is, leaves it erased.
    pub fn new(key: u32, value: &[u32]) -> Self {
        let mut record = Self::erased();
        let bytes = record.bytes_mut(Self::size(value.len()));
        if let Some((content, crc)) = bytes.split_last_chunk_mut() {
            let places = content.as_chunks_mut().0.iter_mut();
            for (place, word) in places.zip(iter::once(&key).chain(value)) {
                *place = word.to_le_bytes();
            }
            *crc = crc32(words_of(content)).to_le_bytes();
        }
        record
    }

    /// One without bytes, to be read into.
    pub fn erased() -> Self {
        let bytes = [0xFF; _];
        Self { bytes, size: 0 }
    }

    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.size).unwrap_or_default()
    }

    /// Its bytes, `size` from now on, to be read into.
    pub fn bytes_mut(&mut self, size: usize) -> &mut [u8] {
        self.size = size;
        self.bytes.get_mut(..size).unwrap_or_default()
    }

    pub fn key(&self) -> u32 {
        words_of(&self.bytes).next().unwrap_or_default()
    }

    /// The words of the value, and those after it: a type of value takes its own.
    pub fn value(&self) -> impl Iterator<Item = u32> {
        words_of(&self.bytes).skip(1)
    }

    /// Appends zeros to a value of fewer words.
    pub fn widen(&mut self, words: usize) {
        let old_words = (self.size / size_of::<u32>()).saturating_sub(2);
        if old_words < words {
            let mut value = [0; MAX_WORDS];
            for (place, word) in value.iter_mut().zip(self.value().take(old_words)) {
                *place = word;
            }
            *self = Self::new(self.key(), value.get(..words).unwrap_or_default());
        }
    }

    /// Takes these bytes if their CRC is right, and returns whether it is.
    pub fn replace(&mut self, bytes: &[u8]) -> bool {
        let is_record = Slot::of(bytes) == Slot::Record;
        if is_record {
            let places = self.bytes_mut(bytes.len()).iter_mut();
            places.zip(bytes).for_each(|(place, byte)| *place = *byte);
        }
        is_record
    }

    /// The number of a header, which increases with every sector, if `magic` identifies its layout.
    pub fn sequence(&self, magic: u32) -> Option<u32> {
        let is_header = Slot::of(self.bytes()) == Slot::Record && self.key() == magic;
        self.value().next().filter(|_| is_header)
    }
}

impl Slot {
    /// That with these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        match bytes.split_last_chunk() {
            _ if bytes.iter().all(|byte| *byte == 0xFF) => Self::Blank,
            Some((content, crc)) if u32::from_le_bytes(*crc) == crc32(words_of(content)) => Self::Record,
            _ => Self::Damaged,
        }
    }
}

fn words_of(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word))
}

#[cfg(test)]
mod tests {
    use super::super::region::Layout;
    use super::*;

    const SIZE: usize = StoredRecord::size(1);
    const MAGIC: u32 = Layout::Single.magic(1);

    fn slot(bytes: [u8; SIZE]) -> Slot {
        Slot::of(&bytes)
    }

    fn sequence(bytes: &[u8], magic: u32) -> Option<u32> {
        let mut header = StoredRecord::erased();
        header.replace(bytes);
        header.sequence(magic)
    }

    #[test]
    fn erased_and_zero_bytes_are_no_record_or_header() {
        assert_eq!(slot([0xFF; SIZE]), Slot::Blank);
        assert_eq!(slot([0; SIZE]), Slot::Damaged);
        assert_eq!(sequence(&[0xFF; SIZE], MAGIC), None);
        assert_eq!(sequence(&[0; SIZE], MAGIC), None);
        assert_eq!(Slot::of(&[0xFF; 64]), Slot::Blank);
        assert_eq!(Slot::of(&[0; 64]), Slot::Damaged);
    }

    #[test]
    fn bytes_are_as_documented() {
        // CRCs by `zlib.crc32`.
        assert_eq!(
            StoredRecord::new(66, &[4.1_f32.to_bits()]).bytes(),
            [0x42, 0, 0, 0, 0x33, 0x33, 0x83, 0x40, 0x67, 0x9c, 0x5b, 0xac]
        );
        assert_eq!(
            StoredRecord::new(MAGIC, &[7]).bytes(),
            [b'P', b'A', b'R', b'1', 7, 0, 0, 0, 0x11, 0x52, 0xa8, 0x92]
        );
        assert_eq!(
            StoredRecord::new(Layout::Double.magic(1), &[7]).bytes(),
            [b'P', b'A', b'D', b'1', 7, 0, 0, 0, 0x97, 0xb3, 0x27, 0x47]
        );
    }

    #[test]
    fn header_of_another_width_or_layout_is_none() {
        let other_width = Layout::Single.magic(14);
        let other_layout = Layout::Double.magic(1);
        for magic in [other_width, other_layout] {
            let header = StoredRecord::new(magic, &[7]);
            assert_eq!(sequence(header.bytes(), MAGIC), None);
            assert_eq!(sequence(header.bytes(), magic), Some(7));
        }
    }

    #[test]
    fn up_to_three_flipped_bits_are_detected() {
        let record = StoredRecord::new(7, &[1.5_f32.to_bits()]);
        let bytes = *record.bytes().as_array().unwrap();
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
        let record = StoredRecord::new(7, &core::array::from_fn::<u32, 14, _>(|word| word as u32));
        let flip = |mut bytes: [u8; 64], bit: usize| {
            bytes[bit / 8] ^= 1 << (bit % 8);
            bytes
        };
        let bytes = *record.bytes().as_array().unwrap();
        assert_eq!(bytes[60..], [0x3e, 0x6e, 0xde, 0x4b]);
        assert_eq!(Slot::of(&bytes), Slot::Record);
        for a in 0..64 * 8 {
            assert_eq!(Slot::of(&flip(bytes, a)), Slot::Damaged);
            for b in 0..a {
                assert_eq!(Slot::of(&flip(flip(bytes, a), b)), Slot::Damaged);
            }
        }
    }
}
