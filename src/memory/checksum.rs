//! CRC-32.

use crc::{CRC_32_ISO_HDLC, Crc, Table};

/// The remainder of each byte. The crate's own loop over bytes serves any algorithm: with it a board's first second, in which
/// the program is hashed, takes 30.6 million instructions instead of 26.8.
static TABLE: [u32; 256] = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC).table()[0];

/// Takes the byte that was added to the lowest bits.
fn step(crc: u32) -> u32 {
    (crc >> 8) ^ TABLE[(crc & 0xff) as usize]
}

/// The checksum of words that come one after the other, as of their bytes in little-endian order.
pub(crate) struct Crc32(u32);

impl Crc32 {
    /// Of no words.
    pub(crate) fn new() -> Self {
        Self(u32::MAX)
    }

    /// Takes the next word.
    pub(crate) fn add(&mut self, word: u32) {
        let crc = self.0 ^ word;
        self.0 = step(step(step(step(crc))));
    }

    /// The checksum of all words so far.
    pub(crate) fn value(&self) -> u32 {
        !self.0
    }
}

/// The checksum of a file as MAVLink FTP has it, of which `crc` is that of the bytes before; it begins with 0, and is not
/// inverted at the end.
pub(crate) fn file_crc32(crc: u32, bytes: &[u8]) -> u32 {
    bytes.iter().fold(crc, |crc, byte| step(crc ^ u32::from(*byte)))
}

/// The checksum of `words`. Neither all zeros nor all ones are sealed by it.
pub(crate) fn crc32(words: impl IntoIterator<Item = u32>) -> u32 {
    let mut crc = Crc32::new();
    words.into_iter().for_each(|word| crc.add(word));
    crc.value()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_that_of_ethernet() {
        // `zlib.crc32` of the same bytes.
        let words = [u32::from_le_bytes(*b"1234"), u32::from_le_bytes(*b"5678")];
        assert_eq!(crc32(words), 0x9AE0_DAAF);
        assert_eq!(crc32([0, 0]), 0x6522_DF69);
    }

    #[test]
    fn that_of_a_file_begins_with_0_and_is_not_inverted() {
        // `zlib.crc32(data, 0xffffffff) ^ 0xffffffff` of the same bytes.
        assert_eq!(file_crc32(0, b"123456789"), 0x2DFD_2D88);
        assert_eq!(file_crc32(file_crc32(0, b"1234"), b"56789"), 0x2DFD_2D88);
    }
}
