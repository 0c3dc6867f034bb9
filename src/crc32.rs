//! The CRC-32 of Ethernet, over whole words.

/// The polynomial's remainder for each value of four bits.
const REMAINDERS: [u32; 16] = remainders();

const fn remainders() -> [u32; 16] {
    let mut remainders = [0; 16];
    let mut nibble = 0;
    while nibble < remainders.len() {
        let mut crc = nibble as u32;
        let mut bit = 0;
        while bit < 4 {
            crc = (crc >> 1) ^ (0xEDB8_8320 * (crc & 1));
            bit += 1;
        }
        remainders[nibble] = crc;
        nibble += 1;
    }
    remainders
}

/// The checksum of `words`, as of their bytes in little-endian order. Neither all zeros nor all ones are sealed by it.
pub(crate) fn crc32(words: impl IntoIterator<Item = u32>) -> u32 {
    let crc = words.into_iter().fold(u32::MAX, |mut crc, word| {
        crc ^= word;
        for _ in 0..u32::BITS / 4 {
            crc = (crc >> 4) ^ REMAINDERS[(crc & 0xf) as usize];
        }
        crc
    });
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_that_of_ethernet() {
        // `zlib.crc32` of the same bytes.
        let words = [u32::from_le_bytes(*b"1234"), u32::from_le_bytes(*b"5678")];
        assert_eq!(crc32(words), 0x9AE0_DAAF);
        assert_eq!(crc32([0, 0]), 0x6522_DF69);
    }
}
