//! Stored data of Wi-Fi, as words under keys.
//!
//! | byte | content |
//! |---|---|
//! | 0 | length of the name, 0 for the board's own network |
//! | 1 | length of the password, 0 for an open network |
//! | 2 to 33 | name |
//! | 34 to 96 | password |

use super::{Network, Password, Ssid};

/// Words of a [`WifiRecord`] in flash.
pub const WIFI_WORDS: usize = BYTES.div_ceil(WORD);

const WORD: usize = size_of::<u32>();
const NAME_AT: usize = 2;
const PASSWORD_AT: usize = NAME_AT + Ssid::MAX_BYTES;
const BYTES: usize = PASSWORD_AT + Password::MAX_BYTES;

/// Keys of the records. These numbers never change.
const OWN_PASSWORD: u16 = 1;
const NETWORK: u16 = 2;

/// Stored data of Wi-Fi. A value that was never set, or can't be read, is `None`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StoredWifi {
    /// The password of the board's own network.
    pub own_password: Option<Password>,
    /// The network to join.
    pub network: Option<Network>,
}

impl StoredWifi {
    /// Takes a record that was found in flash. One with an unknown key, or with what no firmware has written, is ignored.
    pub fn found(&mut self, key: u16, words: &[u32; WIFI_WORDS]) {
        match key {
            OWN_PASSWORD => self.own_password = password(words),
            NETWORK => self.network = network(words),
            _ => {}
        }
    }
}

/// Something that has to be written to flash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WifiRecord {
    /// The password of the board's own network.
    OwnPassword(Password),
    /// The network to join.
    Network(Network),
}

impl WifiRecord {
    /// Flash key.
    pub fn key(&self) -> u16 {
        match self {
            Self::OwnPassword(_) => OWN_PASSWORD,
            Self::Network(_) => NETWORK,
        }
    }

    /// As words.
    pub fn to_words(&self) -> [u32; WIFI_WORDS] {
        match self {
            Self::OwnPassword(password) => words("", password.as_str()),
            Self::Network(Network { ssid, password }) => {
                words(ssid.as_str(), password.as_ref().map_or("", Password::as_str))
            }
        }
    }
}

fn words(name: &str, password: &str) -> [u32; WIFI_WORDS] {
    let mut bytes = [0; WIFI_WORDS * WORD];
    // Both are shorter than 256 bytes.
    let lengths = [name.len() as u8, password.len() as u8];
    put(&mut bytes, 0, &lengths);
    put(&mut bytes, NAME_AT, name.as_bytes());
    put(&mut bytes, PASSWORD_AT, password.as_bytes());
    let mut words = [0; WIFI_WORDS];
    for (word, bytes) in words.iter_mut().zip(bytes.as_chunks().0) {
        *word = u32::from_le_bytes(*bytes);
    }
    words
}

fn put(bytes: &mut [u8], at: usize, content: &[u8]) {
    for (to, from) in bytes.iter_mut().skip(at).zip(content) {
        *to = *from;
    }
}

fn bytes(words: &[u32; WIFI_WORDS]) -> [u8; WIFI_WORDS * WORD] {
    let mut bytes = [0; WIFI_WORDS * WORD];
    for (to, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
        *to = word.to_le_bytes();
    }
    bytes
}

/// `None` if there is no valid password.
fn password(words: &[u32; WIFI_WORDS]) -> Option<Password> {
    let bytes = bytes(words);
    let [_, length, ..] = bytes;
    Password::new(bytes.get(PASSWORD_AT..PASSWORD_AT + usize::from(length))?)
}

/// `None` if the name is not valid, or if there is a password that is not.
fn network(words: &[u32; WIFI_WORDS]) -> Option<Network> {
    let bytes = bytes(words);
    let [name_length, password_length, ..] = bytes;
    let ssid = Ssid::new(bytes.get(NAME_AT..NAME_AT + usize::from(name_length))?)?;
    let password = match password_length {
        0 => None,
        _ => Some(password(words)?),
    };
    Some(Network { ssid, password })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stored(record: &WifiRecord) -> StoredWifi {
        let mut stored = StoredWifi::default();
        stored.found(record.key(), &record.to_words());
        stored
    }

    fn passwords() -> impl Strategy<Value = Password> {
        "[ -~]{8,63}".prop_map(|text| Password::new(text.as_bytes()).expect("valid"))
    }

    fn names() -> impl Strategy<Value = Ssid> {
        "[ -~\u{e4}\u{20ac}]{1,10}".prop_map(|text| Ssid::new(text.as_bytes()).expect("valid"))
    }

    #[test]
    fn the_words_of_a_network_never_change() {
        let network = Network {
            ssid: Ssid::new(b"home").unwrap(),
            password: Password::new(b"12345678"),
        };
        let words = WifiRecord::Network(network).to_words();
        assert_eq!(words.len(), 25);
        assert_eq!(words[0].to_le_bytes(), [4, 8, b'h', b'o']);
        assert_eq!(words[8].to_le_bytes(), [0, 0, b'1', b'2']);
    }

    #[test]
    fn an_unknown_key_is_ignored() {
        let mut stored = StoredWifi::default();
        let record = WifiRecord::OwnPassword(Password::new(b"12345678").unwrap());
        stored.found(3, &record.to_words());
        assert_eq!(stored, StoredWifi::default());
    }

    proptest! {
        #[test]
        fn a_password_is_read_as_it_was_stored(password in passwords()) {
            let record = WifiRecord::OwnPassword(password.clone());
            prop_assert_eq!(stored(&record).own_password, Some(password));
        }

        #[test]
        fn a_network_is_read_as_it_was_stored(ssid in names(), password in prop::option::of(passwords())) {
            let network = Network { ssid, password };
            let record = WifiRecord::Network(network.clone());
            prop_assert_eq!(stored(&record).network, Some(network));
        }

        #[test]
        fn whatever_is_stored_what_is_read_can_be_stored(key in 0u16..4, words: [u32; WIFI_WORDS]) {
            let mut found = StoredWifi::default();
            found.found(key, &words);
            if let Some(password) = found.own_password {
                let record = WifiRecord::OwnPassword(password.clone());
                prop_assert_eq!(stored(&record).own_password, Some(password));
            }
            if let Some(network) = found.network {
                let record = WifiRecord::Network(network.clone());
                prop_assert_eq!(stored(&record).network, Some(network));
            }
        }
    }
}
