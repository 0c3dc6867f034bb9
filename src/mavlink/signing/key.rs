//! The secret, and what it proves.

use core::fmt;

use sha2::{Digest, Sha256};

const KEY_BYTES: usize = 32;
pub const KEY_WORDS: usize = KEY_BYTES / size_of::<u32>();

/// The part of the hash that is sent.
pub const SIGNATURE_BYTES: usize = 6;

/// The secret that both ends of a link know. It never leaves the board again.
#[derive(Clone, PartialEq, Eq)]
pub struct SigningKey([u8; KEY_BYTES]);

impl SigningKey {
    /// The key of these bytes; `None` if all are zero, which stands for no key at all.
    pub fn new(bytes: [u8; KEY_BYTES]) -> Option<Self> {
        (bytes != [0; KEY_BYTES]).then_some(Self(bytes))
    }

    /// The signature under a frame up to and with its timestamp.
    pub(super) fn signature(&self, signed: &[u8]) -> [u8; SIGNATURE_BYTES] {
        let hash: [u8; 32] = Sha256::new()
            .chain_update(self.0)
            .chain_update(signed)
            .finalize()
            .into();
        let [a, b, c, d, e, f, ..] = hash;
        [a, b, c, d, e, f]
    }

    pub(super) fn from_words(words: [u32; KEY_WORDS]) -> Option<Self> {
        let mut bytes = [0; KEY_BYTES];
        for (target, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
            *target = word.to_le_bytes();
        }
        Self::new(bytes)
    }

    pub(super) fn to_words(&self) -> [u32; KEY_WORDS] {
        let mut words = [0; KEY_WORDS];
        for (word, bytes) in words.iter_mut().zip(self.0.as_chunks().0) {
            *word = u32::from_le_bytes(*bytes);
        }
        words
    }
}

/// A log that shows keys gives them away.
impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SigningKey")
    }
}
