//! The first bytes of a sector: its header, the mark of an erase, and the date of a file. Little-endian words, the last of
//! each a CRC-32.

use core::num::NonZeroU32;

use super::geometry::SECTOR_BYTES;
use crate::memory::checksum::crc32;

/// Bytes before the payload: header, mark, date.
pub const FRONT_BYTES: u32 = 32;

/// Bytes of a log file that a sector holds.
pub const PAYLOAD_BYTES: u32 = SECTOR_BYTES - FRONT_BYTES;

/// Bytes of a header.
pub const HEADER_BYTES: usize = 16;

/// Bytes of a mark.
pub const MARK_BYTES: usize = 8;

/// Offset of the mark in its sector.
pub const MARK_AT: u32 = HEADER_BYTES as u32;

/// Bytes of a date.
pub const DATE_BYTES: usize = 8;

/// Offset of the date in the first sector of a file.
pub const DATE_AT: u32 = MARK_AT + MARK_BYTES as u32;

/// Identifies a header, and the layout of its sector.
const HEADER_MAGIC: u32 = u32::from_le_bytes(*b"LOG1");

/// Enters the checksum of a mark.
const MARK_MAGIC: u32 = u32::from_le_bytes(*b"ERS1");

/// Enters the checksum of a date.
const DATE_MAGIC: u32 = u32::from_le_bytes(*b"DAT1");

/// Sequence numbers from here on are invalid. Flash is worn out after some 100,000 laps, at 31 million.
const SEQUENCE_END: u32 = 1 << 31;

/// Use of a sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Which sector it is, of all that were ever used.
    pub sequence: u32,
    /// The number of the file, from 1.
    pub number: u16,
    /// Sectors of the file before this one.
    pub index: u16,
}

/// The proof that the front of a sector gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Front {
    pub header: HeaderSlot,
    /// The sector was erased completely, to be used as this one. Stays when the sector is used.
    pub erased_for: Option<u32>,
    /// When the file that begins in the sector began, in seconds since 1970 (UTC).
    pub began_utc_s: Option<NonZeroU32>,
}

/// Content of the place of a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeaderSlot {
    /// Erased.
    Blank,
    Header(Header),
    /// An interrupted operation, flipped bits or anything else.
    Damaged,
}

impl Header {
    /// The bytes in a ring of this many sectors.
    pub fn to_bytes(self, sectors: u32) -> [u8; HEADER_BYTES] {
        let file = u32::from(self.number) | u32::from(self.index) << 16;
        let crc = crc32([HEADER_MAGIC, self.sequence, file, sectors]);
        to_bytes([HEADER_MAGIC, self.sequence, file, crc])
    }

    fn from_words(words: [u32; HEADER_BYTES / 4], sectors: u32) -> Option<Self> {
        let [magic, sequence, file, crc] = words;
        let header = Self {
            sequence,
            number: file as u16,
            index: (file >> 16) as u16,
        };
        let is_header = magic == HEADER_MAGIC
            && crc == crc32([magic, sequence, file, sectors])
            && is_sequence(sequence, sectors)
            && header.number > 0
            && header.first_sequence() >= sectors;
        is_header.then_some(header)
    }

    /// The first sector of the file.
    pub fn first_sequence(self) -> u32 {
        self.sequence.saturating_sub(self.index.into())
    }
}

/// The mark of a sector that was erased completely, to be used as the one with `sequence`.
///
/// An interrupted erase may leave the mark of the lap before, which has another sequence number.
pub fn mark(sequence: u32, sectors: u32) -> [u8; MARK_BYTES] {
    to_bytes([sequence, crc32([MARK_MAGIC, sequence, sectors])])
}

/// The date of a file that began at this moment, in seconds since 1970.
///
/// It is programmed into a sector that was erased completely, so that none of an earlier lap can be left. If that is
/// interrupted the checksum is wrong, and the moment unknown.
pub fn date(began_utc_s: NonZeroU32, sectors: u32) -> [u8; DATE_BYTES] {
    let seconds = began_utc_s.get();
    to_bytes([seconds, crc32([DATE_MAGIC, seconds, sectors])])
}

impl Front {
    /// The front of a sector that can't be read.
    pub const UNREADABLE: Self = Self {
        header: HeaderSlot::Damaged,
        erased_for: None,
        began_utc_s: None,
    };

    /// The proof that `bytes` give in a ring of this many sectors.
    pub fn from_bytes(bytes: &[u8; FRONT_BYTES as usize], sectors: u32) -> Self {
        let mut words = [0; FRONT_BYTES as usize / 4];
        for (word, bytes) in words.iter_mut().zip(bytes.as_chunks().0) {
            *word = u32::from_le_bytes(*bytes);
        }
        let [a, b, c, d, sequence, mark_crc, seconds, date_crc] = words;
        let is_mark = mark_crc == crc32([MARK_MAGIC, sequence, sectors]) && is_sequence(sequence, sectors);
        let is_date = date_crc == crc32([DATE_MAGIC, seconds, sectors]);
        Self {
            header: HeaderSlot::from_words([a, b, c, d], sectors),
            erased_for: is_mark.then_some(sequence),
            began_utc_s: NonZeroU32::new(seconds).filter(|_| is_date),
        }
    }
}

impl HeaderSlot {
    fn from_words(words: [u32; HEADER_BYTES / 4], sectors: u32) -> Self {
        if words == [u32::MAX; HEADER_BYTES / 4] {
            return Self::Blank;
        }
        Header::from_words(words, sectors).map_or(Self::Damaged, Self::Header)
    }
}

fn is_sequence(sequence: u32, sectors: u32) -> bool {
    (sectors..SEQUENCE_END).contains(&sequence)
}

fn to_bytes<const WORDS: usize, const BYTES: usize>(words: [u32; WORDS]) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    for (place, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
        *place = word.to_le_bytes();
    }
    bytes
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SECTORS: u32 = 292;
    const BEGAN: NonZeroU32 = NonZeroU32::new(1_800_000_000).unwrap();
    const HEADER: Header = Header {
        sequence: 1000,
        number: 7,
        index: 2,
    };

    fn front(header: &[u8], mark: &[u8]) -> Front {
        let mut bytes = [0xFF; FRONT_BYTES as usize];
        bytes[..HEADER_BYTES].copy_from_slice(header);
        bytes[HEADER_BYTES..HEADER_BYTES + MARK_BYTES].copy_from_slice(mark);
        Front::from_bytes(&bytes, SECTORS)
    }

    #[test]
    fn layout_is_unchanged() {
        // CRCs by `zlib.crc32`.
        assert_eq!(
            HEADER.to_bytes(SECTORS),
            *b"LOG1\xe8\x03\x00\x00\x07\x00\x02\x00\x47\x56\xeb\xbb"
        );
        assert_eq!(mark(1000, SECTORS), *b"\xe8\x03\x00\x00\xa7\xfd\xe1\xd7");
        assert_eq!(date(BEGAN, SECTORS), *b"\x00\xd2\x49\x6b\xa6\x23\xb8\x02");
    }

    #[test]
    fn date_is_read_back_unless_a_bit_of_it_is_flipped() {
        let mut bytes = [0xFF; FRONT_BYTES as usize];
        bytes[DATE_AT as usize..].copy_from_slice(&date(BEGAN, SECTORS));
        assert_eq!(Front::from_bytes(&bytes, SECTORS).began_utc_s, Some(BEGAN));
        assert_eq!(Front::from_bytes(&bytes, SECTORS - 1).began_utc_s, None);
        for bit in DATE_AT as usize * 8..FRONT_BYTES as usize * 8 {
            let mut flipped = bytes;
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(
                Front::from_bytes(&flipped, SECTORS).began_utc_s,
                None,
                "bit {bit}"
            );
        }
    }

    #[test]
    fn header_and_mark_are_read_back() {
        let read = front(&HEADER.to_bytes(SECTORS), &mark(1000, SECTORS));
        assert_eq!(read.header, HeaderSlot::Header(HEADER));
        assert_eq!(read.erased_for, Some(1000));
    }

    #[test]
    fn erased_and_zero_bytes_prove_nothing() {
        let blank = Front::from_bytes(&[0xFF; FRONT_BYTES as usize], SECTORS);
        assert_eq!((blank.header, blank.erased_for), (HeaderSlot::Blank, None));
        assert_eq!(blank.began_utc_s, None);
        let zeros = Front::from_bytes(&[0; FRONT_BYTES as usize], SECTORS);
        assert_eq!(zeros, Front::UNREADABLE);
    }

    #[test]
    fn ring_of_another_size_is_not_taken_over() {
        let read = front(&HEADER.to_bytes(SECTORS - 1), &mark(1000, SECTORS - 1));
        assert_eq!(read, Front::UNREADABLE);
    }

    #[test]
    fn impossible_headers_are_damage() {
        let impossible = [
            Header { number: 0, ..HEADER },
            // Before the first sector, and its file before it.
            Header {
                sequence: SECTORS - 1,
                index: 0,
                ..HEADER
            },
            Header {
                sequence: SECTORS + 1,
                ..HEADER
            },
            Header {
                sequence: SEQUENCE_END,
                ..HEADER
            },
        ];
        for header in impossible {
            let read = front(&header.to_bytes(SECTORS), &[0xFF; MARK_BYTES]);
            assert_eq!(read.header, HeaderSlot::Damaged, "{header:?}");
        }
    }

    proptest! {
        #[test]
        fn flipped_bits_are_detected(bits in prop::collection::hash_set(0..HEADER_BYTES * 8, 1..4)) {
            let mut bytes = HEADER.to_bytes(SECTORS);
            for bit in &bits {
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            let mark_bits = bits.iter().filter(|bit| **bit < MARK_BYTES * 8);
            let mut mark = mark(1000, SECTORS);
            for bit in mark_bits.clone() {
                mark[bit / 8] ^= 1 << (bit % 8);
            }
            let read = front(&bytes, &mark);
            prop_assert_eq!(read.header, HeaderSlot::Damaged);
            prop_assert_eq!(read.erased_for.is_none(), mark_bits.count() > 0);
        }
    }
}
