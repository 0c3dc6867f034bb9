//! The CRC of transfers: CRC-16/CCITT-FALSE over the signature of the data type and the payload.

use crc::{CRC_16_IBM_3740, Crc, NoTable};

/// Without a table, which would take 512 bytes: a battery's transfer takes some 50 µs.
const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_IBM_3740);

/// The CRC of a data type's signature, with which that of its transfers begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SignatureCrc(u16);

impl SignatureCrc {
    /// Of a signature.
    pub const fn of(signature: u64) -> Self {
        Self(CRC.checksum(&signature.to_le_bytes()))
    }

    /// The CRC of a transfer.
    pub fn of_transfer(self, payload: &[u8]) -> u16 {
        // This CRC is neither reflected nor inverted, so it goes on from where another has ended.
        let mut digest = CRC.digest_with_initial(self.0);
        digest.update(payload);
        digest.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `base_crc` of the data types in PyPI `dronecan` 1.0.27.
    #[test]
    fn signatures_have_the_crc_of_the_reference() {
        for (signature, crc) in [
            (0x249c_2654_8a71_1966, 0xf674),
            (0x7d7f_49fc_7548_4882, 0xb0c5),
            (0xdd70_96b2_55fb_6358, 0x2fca),
            (0x0b2a_8126_20a1_1d40, 0xf258),
        ] {
            assert_eq!(SignatureCrc::of(signature), SignatureCrc(crc));
        }
    }
}
