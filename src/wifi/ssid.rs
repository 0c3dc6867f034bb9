//! The name of a network.

use heapless::String;

use crate::memory::identity::BoardId;

/// Hexadecimal digits of the board's number in the name of its access point.
const BOARD_DIGITS: usize = 4;

/// The name of a network (SSID): 1 to 32 bytes. IEEE 802.11 allows any bytes; the radio's driver takes text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ssid(String<{ Ssid::MAX_BYTES }>);

impl Ssid {
    /// Maximum length, in bytes.
    pub const MAX_BYTES: usize = 32;

    /// The name with these bytes; `None` if there are none or too many, or if they are not UTF-8 text without control
    /// characters.
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let text = core::str::from_utf8(bytes).ok()?;
        let is_valid = !text.is_empty() && !text.contains(char::is_control);
        let name = String::try_from(text).ok()?;
        is_valid.then_some(Self(name))
    }

    /// The name of a board's own network: `rover-` and the last digits of its serial number, or `rover` without one.
    pub fn of_board(id: Option<BoardId>) -> Self {
        let mut name = String::new();
        // It all fits.
        let _ = name.push_str("rover");
        if let Some(id) = id {
            let number = id.serial_number();
            let digits = number.len().saturating_sub(BOARD_DIGITS);
            let _ = name.push('-');
            let _ = name.push_str(number.get(digits..).unwrap_or_default());
        }
        Self(name)
    }

    /// As text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_one_to_32_bytes_of_text() {
        for valid in ["a", "caf\u{e9} am See", &"x".repeat(32), &"\u{20ac}".repeat(10)] {
            assert_eq!(Ssid::new(valid.as_bytes()).expect(valid).as_str(), valid);
        }
        let long = "x".repeat(33);
        for invalid in [&b""[..], b"a\nb", b"a\0", b"\xff\xfe", long.as_bytes()] {
            assert_eq!(Ssid::new(invalid), None, "{invalid:?}");
        }
    }

    #[test]
    fn a_board_has_its_last_digits_in_its_name() {
        let id = BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c]);
        assert_eq!(Ssid::of_board(Some(id)).as_str(), "rover-0A2C");
        assert_eq!(Ssid::of_board(None).as_str(), "rover");
    }
}
