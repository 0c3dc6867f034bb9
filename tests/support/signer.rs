//! A ground station that signs, written from MAVLink's description of message signing.

use sha2::{Digest, Sha256};

use crate::frames::{Frame, SIGNATURE_BYTES, declare_signed};

/// Of these bytes the keys are made.
pub const OWNER: u8 = 7;
pub const STRANGER: u8 = 8;

/// 2026-01-01 00:00 UTC, in tens of microseconds since 2015.
pub const NEW_YEAR: u64 = 4018 * 86_400 * 100_000;

/// A sender with a key.
#[derive(Clone)]
pub struct Signer {
    pub key: [u8; 32],
    pub link: u8,
    /// Of the next frame.
    pub timestamp: u64,
}

impl Signer {
    /// One whose key is made of this byte.
    pub fn new(key: u8) -> Self {
        Self {
            key: [key; 32],
            link: 3,
            timestamp: NEW_YEAR,
        }
    }

    /// Signs a frame.
    pub fn sign(&mut self, frame: &[u8]) -> Vec<u8> {
        let mut signed = declare_signed(frame);
        signed.push(self.link);
        signed.extend(&self.timestamp.to_le_bytes()[..6]);
        signed.extend(self.signature(&signed));
        self.timestamp += 1;
        signed
    }

    /// Takes over the timestamps of these frames if they are ahead. All of them are signed with this key.
    pub fn hear<'a>(&mut self, frames: impl IntoIterator<Item = &'a Frame>) {
        for frame in frames {
            let (_, time) = self.verify(frame);
            self.timestamp = self.timestamp.max(time + 1);
        }
    }

    /// The link and the time of a frame that is signed with this key.
    pub fn verify(&self, frame: &Frame) -> (u8, u64) {
        let bytes = frame.signed.as_deref().expect("the frame is not signed");
        let (covered, signature) = bytes.split_at(bytes.len() - SIGNATURE_BYTES);
        assert_eq!(signature, self.signature(covered), "signed with another key");
        let mut timestamp = [0; 8];
        timestamp[..6].copy_from_slice(&covered[covered.len() - 6..]);
        (covered[covered.len() - 7], u64::from_le_bytes(timestamp))
    }

    fn signature(&self, covered: &[u8]) -> [u8; SIGNATURE_BYTES] {
        let hash = Sha256::new()
            .chain_update(self.key)
            .chain_update(covered)
            .finalize();
        hash[..SIGNATURE_BYTES].try_into().expect("a hash is longer")
    }
}
