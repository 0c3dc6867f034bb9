//! Chance, from the jitter of the chip's ring oscillator.

use embassy_rp::clocks::RoscRng;
use sha2::{Digest, Sha256};

/// Bits of the oscillator for each bit of the result. They are neither independent nor fair (RP2040 datasheet, 2.17.5), so
/// many of them are hashed.
const RAW_BYTES: u32 = 16 * 32;

/// Of bits that have nothing to do with each other half of all differ from the one before. An oscillator that stands still, or
/// swings in step with the processor, gives few such changes or one after the other.
const MIN_CHANGES: u32 = RAW_BYTES * u8::BITS / 8;
const MAX_CHANGES: u32 = RAW_BYTES * u8::BITS - MIN_CHANGES;

/// 32 bytes that can't be guessed; `None` if the oscillator gives none.
pub fn entropy() -> Option<[u8; 32]> {
    let mut hash = Sha256::new();
    let mut changes = 0;
    for _ in 0..RAW_BYTES {
        let byte = RoscRng::next_u8();
        changes += (byte ^ byte.rotate_left(1)).count_ones();
        hash.update([byte]);
    }
    (MIN_CHANGES..=MAX_CHANGES)
        .contains(&changes)
        .then(|| hash.finalize().into())
}
