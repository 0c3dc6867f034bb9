//! The hash FNV-1a of 32 bits (draft-eastlake-fnv).

use core::hash::Hasher;

const PRIME: u32 = 0x0100_0193;

/// The hash of what is written to it.
pub(crate) struct Fnv(u32);

impl Fnv {
    /// Of nothing.
    pub(crate) fn new() -> Self {
        Self(0x811c_9dc5)
    }

    /// Of these bytes.
    pub(crate) fn hash_of(bytes: &[u8]) -> u32 {
        let mut hasher = Self::new();
        hasher.write(bytes);
        hasher.hash()
    }

    /// The hash.
    pub(crate) fn hash(&self) -> u32 {
        self.0
    }
}

impl Hasher for Fnv {
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u32::from(*byte)).wrapping_mul(PRIME);
        }
    }

    fn finish(&self) -> u64 {
        self.0.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_draft() {
        // draft-eastlake-fnv-17, appendix C: FNV-1a, 32 bits.
        assert_eq!(Fnv::hash_of(b""), 0x811c_9dc5);
        assert_eq!(Fnv::hash_of(b"a"), 0xe40c_292c);
        assert_eq!(Fnv::hash_of(b"foobar"), 0xbf9c_f968);
    }
}
