//! Networks: their names and passwords, and one to join.

use core::fmt;

use heapless::String;
use sha2::{Digest, Sha256};

use crate::memory::identity::BoardId;

/// A network to join.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// Its name.
    pub ssid: Ssid,
    /// Its password by WPA2; `None` for an open network.
    pub password: Option<Password>,
}

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

/// Characters of a password that is made here. Without `0` and `o`, `1` and `l`, which look alike; lower-case letters and
/// digits are on the first two pages of a phone's keyboard.
const ALPHABET: &[u8; 32] = b"23456789abcdefghijkmnpqrstuvwxyz";

/// Five bits of each byte choose a character: twelve of them have 60 bits.
const CHARACTERS: usize = 12;

/// Between groups of this many characters there is a dash.
const GROUP: usize = 4;

/// A password by WPA2: 8 to 63 printable ASCII characters. Neither debug output nor a log shows it.
#[derive(Clone, PartialEq, Eq)]
pub struct Password(String<{ Password::MAX_BYTES }>);

impl Password {
    /// Minimum length, in bytes.
    pub const MIN_BYTES: usize = 8;

    /// Maximum length, in bytes.
    pub const MAX_BYTES: usize = 63;

    /// The password with these characters; `None` if they are too few, too many, or not printable ASCII.
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let is_valid = (Self::MIN_BYTES..=Self::MAX_BYTES).contains(&bytes.len())
            && bytes.iter().all(|byte| matches!(byte, b' '..=b'~'));
        let text = core::str::from_utf8(bytes).ok().filter(|_| is_valid)?;
        String::try_from(text).ok().map(Self)
    }

    /// A new password, as `k7mf-2xqp-9drw`. Its 60 bits are as hard to guess as `entropy`, which may be biased: what it
    /// has is spread by a hash.
    pub fn from_entropy(entropy: &[u8; 32]) -> Self {
        let mixed: [u8; 32] = Sha256::digest(entropy).into();
        let mut text = String::new();
        for (place, byte) in mixed.into_iter().take(CHARACTERS).enumerate() {
            // They all fit.
            if place > 0 && place.is_multiple_of(GROUP) {
                let _ = text.push('-');
            }
            let character = ALPHABET.get(usize::from(byte) % ALPHABET.len());
            let _ = text.push(character.copied().unwrap_or_default().into());
        }
        Self(text)
    }

    /// As text, for the radio and for the owner.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// A log that shows passwords gives them away.
impl fmt::Debug for Password {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Password")
    }
}

#[cfg(target_os = "none")]
impl defmt::Format for Password {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "Password");
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use proptest::prelude::*;

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

    #[test]
    fn it_has_8_to_63_printable_characters() {
        let longest = "~".repeat(63);
        for valid in ["12345678", "correct horse", longest.as_str()] {
            assert_eq!(Password::new(valid.as_bytes()).expect(valid).as_str(), valid);
        }
        let long = "x".repeat(64);
        for invalid in [
            &b""[..],
            b"1234567",
            b"12345678\n",
            b"1234567\x7f",
            "p\u{e4}sswort".as_bytes(),
            long.as_bytes(),
        ] {
            assert_eq!(Password::new(invalid), None, "{invalid:?}");
        }
    }

    #[test]
    fn it_is_not_shown() {
        let password = Password::new(b"secret-secret").unwrap();
        assert_eq!(
            format!("{password:?} {:?}", Some(&password)),
            "Password Some(Password)"
        );
    }

    #[test]
    fn no_two_characters_of_the_alphabet_look_alike() {
        let characters: HashSet<_> = ALPHABET.iter().collect();
        assert_eq!(characters.len(), ALPHABET.len());
        assert!(!ALPHABET.iter().any(|character| b"0o1l".contains(character)));
    }

    #[test]
    fn each_bit_of_entropy_makes_another_one() {
        let entropies = (0..256).map(|bit| {
            let mut entropy = [0; 32];
            entropy[bit / 8] = 1 << (bit % 8);
            entropy
        });
        let passwords: HashSet<_> = entropies
            .chain([[0; 32]])
            .map(|entropy| Password::from_entropy(&entropy).as_str().to_owned())
            .collect();
        assert_eq!(passwords.len(), 257);
    }

    proptest! {
        #[test]
        fn a_new_one_is_valid_and_in_three_groups(entropy: [u8; 32]) {
            let password = Password::from_entropy(&entropy);
            let groups: Vec<_> = password.as_str().split('-').collect();
            prop_assert_eq!(groups.iter().map(|group| group.len()).collect::<Vec<_>>(), [4, 4, 4]);
            prop_assert!(groups.concat().bytes().all(|byte| ALPHABET.contains(&byte)));
            prop_assert_eq!(Password::new(password.as_str().as_bytes()), Some(password.clone()));
        }
    }
}
