//! Which board and which program it is.

use core::array;

use embassy_futures::yield_now;

use crate::board_id::BoardId;
use crate::crc32::{Crc32, crc32};

/// What is read of a program at a time takes some 60 µs.
const WORDS_A_TURN: usize = 256;

/// What distinguishes a board and its program from others; `None` if it is unknown, as on a host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// The board's own number.
    pub board_id: Option<BoardId>,
    /// The program's hash.
    pub firmware_hash: Option<FirmwareHash>,
}

/// The CRC-32 (IEEE 802.3, as zlib's) of a program as it is in flash: boot loader, code, constants and the initial values of
/// variables, without any padding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FirmwareHash(u32);

impl FirmwareHash {
    /// Hexadecimal digits of a hash.
    pub const DIGITS: usize = 8;

    /// The hash of a program of these parts, which is read a little at a time: others get their turn while it is read.
    pub(crate) async fn of_slowly<'a>(program: impl IntoIterator<Item = &'a [u32]>) -> Self {
        let mut crc = Crc32::new();
        for part in program {
            for words in part.chunks(WORDS_A_TURN) {
                words.iter().for_each(|word| crc.add(*word));
                yield_now().await;
            }
        }
        Self(crc.value())
    }

    /// The hash of a program of these words.
    pub fn of(program: impl IntoIterator<Item = u32>) -> Self {
        Self(crc32(program))
    }

    /// As a number: its hexadecimal digits are those of [`Self::digits`].
    pub fn number(self) -> u32 {
        self.0
    }

    /// As lower-case hexadecimal digits in ASCII, as ArduPilot sends the start of its git hash.
    pub fn digits(self) -> [u8; Self::DIGITS] {
        array::from_fn(|place| {
            // The first digit is the highest nibble.
            let nibble = self.0.rotate_left(4 * (place as u32 + 1)) & 0xf;
            b"0123456789abcdef"[nibble as usize]
        })
    }
}

#[cfg(test)]
mod tests {
    use embassy_futures::block_on;

    use super::*;

    #[test]
    fn it_has_the_digits_of_the_checksum() {
        // `zlib.crc32` of the same bytes.
        let words = [u32::from_le_bytes(*b"1234"), u32::from_le_bytes(*b"5678")];
        let hash = FirmwareHash::of(words);
        assert_eq!(&hash.digits(), b"9ae0daaf");
        assert_eq!(hash.number(), 0x9ae0_daaf);
        assert_eq!(
            block_on(FirmwareHash::of_slowly([&words[..1], &words[1..]])),
            hash
        );
        assert_eq!(&FirmwareHash(0x0120_ffff).digits(), b"0120ffff");
    }
}
