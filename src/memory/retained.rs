//! `.uninit` RAM: what survives a reset, valid behind a checksum only, since its content is arbitrary after power-on.

use core::array;
use core::sync::atomic::{AtomicU32, Ordering};

use super::checksum::crc32;

/// Words for a static in `.uninit`: what they hold at the start is what they held before it, or anything. They can be
/// written by the fault handler, too.
#[derive(Debug)]
pub struct RetainedWords<const N: usize>([AtomicU32; N]);

impl<const N: usize> RetainedWords<N> {
    /// The zeros are for the compiler: in `.uninit` they are never written.
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; N])
    }

    /// Their content.
    pub fn get(&self) -> [u32; N] {
        array::from_fn(|at| self.0.get(at).map_or(0, |word| word.load(Ordering::Relaxed)))
    }

    /// Has them hold `words`.
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

/// A single value: magic number, value, checksum.
pub type SealedValue = [u32; 3];

/// `value` behind `magic`, which identifies it.
pub(crate) fn sealed(value: u32, magic: u32) -> SealedValue {
    let mut words = [0, value, 0];
    seal(&mut words, magic);
    words
}

/// The value in `words`, if they are valid.
pub(crate) fn sealed_value(words: &SealedValue, magic: u32) -> Option<u32> {
    let &[_, value, _] = words;
    is_sealed(words, magic).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

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
