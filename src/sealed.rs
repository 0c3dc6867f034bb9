//! Words in RAM that survive a reset, or are anything at all after power came on.

use crate::crc32::crc32;

/// Puts `magic` into the first of `words` and a checksum of all others into the last. The magic number tells this layout
/// from others.
pub(crate) fn seal(words: &mut [u32], magic: u32) {
    let Some((checksum, content)) = words.split_last_mut() else {
        return;
    };
    if let Some(first) = content.first_mut() {
        *first = magic;
    }
    *checksum = crc32(content.iter().copied());
}

/// Whether somebody has sealed `words` with `magic`, and nothing has changed since.
pub(crate) fn is_sealed(words: &[u32], magic: u32) -> bool {
    words.split_last().is_some_and(|(checksum, content)| {
        content.first() == Some(&magic) && *checksum == crc32(content.iter().copied())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seal_is_broken_by_any_bit_and_by_another_magic_number() {
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
