//! Checksums and hashes, and `.uninit` RAM, whose content is arbitrary after power-on, guarded by one.

use core::hash::Hasher;
#[cfg(feature = "board")]
use core::{
    array,
    sync::atomic::{AtomicU32, Ordering},
};

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use hash32::{FnvHasher, Hasher as _};

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

/// The hash FNV-1a of 32 bits.
pub(crate) fn fnv(bytes: &[u8]) -> u32 {
    let mut hasher = FnvHasher::default();
    hasher.write(bytes);
    hasher.finish32()
}

/// Words for a static in `.uninit`: what they hold at the start is what they held before it, or anything. They can be
/// written by the fault handler, too.
#[cfg(feature = "board")]
pub(crate) struct RetainedWords<const N: usize>([AtomicU32; N]);

#[cfg(feature = "board")]
impl<const N: usize> RetainedWords<N> {
    /// The zeros are for the compiler: in `.uninit` they are never written.
    pub const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; N])
    }

    pub fn get(&self) -> [u32; N] {
        array::from_fn(|at| self.0.get(at).map_or(0, |word| word.load(Ordering::Relaxed)))
    }

    pub fn set(&self, words: [u32; N]) {
        for (to, from) in self.0.iter().zip(words) {
            to.store(from, Ordering::Relaxed);
        }
    }
}

/// Writes `magic`, which identifies the layout, to the first of `words`, and the CRC of the others to the last.
pub(crate) fn seal(words: &mut [u32], magic: u32) {
    let Some((checksum, content)) = words.split_last_mut() else {
        return;
    };
    if let Some(first) = content.first_mut() {
        *first = magic;
    }
    *checksum = crc32(content.iter().copied());
}

/// Whether `words` begin with `magic` and their CRC is valid.
pub(crate) fn is_sealed(words: &[u32], magic: u32) -> bool {
    words.split_last().is_some_and(|(checksum, content)| {
        content.first() == Some(&magic) && *checksum == crc32(content.iter().copied())
    })
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

    #[test]
    fn any_changed_bit_or_magic_number_is_invalid() {
        let mut words = [0, 1, 2, 3, 0];
        seal(&mut words, 0xCAFE);
        assert!(is_sealed(&words, 0xCAFE));
        assert!(!is_sealed(&words, 0xCAFF));
        for bit in 0..32 * words.len() {
            let mut damaged = words;
            damaged[bit / 32] ^= 1 << (bit % 32);
            assert!(!is_sealed(&damaged, 0xCAFE), "bit {bit}");
        }
        assert!(!is_sealed(&[], 0));
    }
}
