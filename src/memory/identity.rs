//! The numbers by which boards and builds are distinguished.

use core::array;

use embassy_futures::yield_now;
use heapless::String;

use crate::memory::checksum::{Crc32, crc32};

/// Hexadecimal digits of an id.
pub const SERIAL_NUMBER_CHARS: usize = 2 * BoardId::BYTES;

/// The unique id of the board's flash chip, which nothing changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardId(pub [u8; BoardId::BYTES]);

impl BoardId {
    /// Its size.
    pub const BYTES: usize = 8;

    /// As a number: its hexadecimal digits are those of [`Self::serial_number`].
    pub fn number(self) -> u64 {
        u64::from_be_bytes(self.0)
    }

    /// As hexadecimal digits, first byte first: what Raspberry Pi's own tools show of a board.
    pub fn serial_number(self) -> String<SERIAL_NUMBER_CHARS> {
        let mut text = String::new();
        let nibbles = self.0.into_iter().flat_map(|byte| [byte >> 4, byte & 0xf]);
        for digit in nibbles.filter_map(|nibble| char::from_digit(nibble.into(), 16)) {
            // They all fit.
            let _ = text.push(digit.to_ascii_uppercase());
        }
        text
    }
}

/// Words of a program that are read at a time, in some 60 µs.
const WORDS_A_TURN: usize = 256;

/// Identity of a board and its program; `None` if it is unknown, as on a host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// The board's own number.
    pub board_id: Option<BoardId>,
    /// The program's hash.
    pub firmware_hash: Option<FirmwareHash>,
}

/// The CRC-32 (IEEE 802.3, as zlib's) of a program as it is in flash: boot loader, code, constants, the initial values of
/// variables and the files that are served, without any padding.
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

    /// As a word in RAM, where 0 stands for one that is not known yet.
    pub fn to_word(hash: Option<Self>) -> u32 {
        hash.map_or(0, Self::number)
    }

    /// From [`Self::to_word`].
    pub fn from_word(word: u32) -> Option<Self> {
        (word != 0).then_some(Self(word))
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
    fn the_serial_number_has_two_digits_a_byte() {
        let id = BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c]);
        assert_eq!(id.serial_number(), "E660583883450A2C");
        assert_eq!(format!("{:016X}", id.number()), id.serial_number().as_str());
        assert_eq!(BoardId([0; 8]).serial_number(), "0000000000000000");
    }

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
