//! The number by which boards are distinguished.

use heapless::String;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_serial_number_has_two_digits_a_byte() {
        let id = BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c]);
        assert_eq!(id.serial_number(), "E660583883450A2C");
        assert_eq!(format!("{:016X}", id.number()), id.serial_number().as_str());
        assert_eq!(BoardId([0; 8]).serial_number(), "0000000000000000");
    }
}
