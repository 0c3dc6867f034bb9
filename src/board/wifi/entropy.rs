//! Chance, from the jitter of the chip's ring oscillator.

use embassy_rp::clocks::RoscRng;
use sha2::{Digest, Sha256};

/// Bits of the oscillator for each bit of the result. They are neither independent nor fair (RP2040 datasheet, 2.17.5), so
/// many of them are hashed.
const RAW_BYTES: usize = 16 * 32;

/// 32 bytes that can't be guessed.
pub fn entropy() -> [u8; 32] {
    let mut hash = Sha256::new();
    for _ in 0..RAW_BYTES {
        hash.update([RoscRng::next_u8()]);
    }
    hash.finalize().into()
}
