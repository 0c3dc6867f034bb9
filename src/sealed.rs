//! Magic number and CRC guard for `.uninit` RAM, whose content is arbitrary after power-on.

use crate::crc32::crc32;

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
