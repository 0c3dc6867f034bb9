//! Chance, from the jitter of the chip's ring oscillator.

use cortex_m::asm;
use embassy_futures::yield_now;
use embassy_rp::pac;

use crate::memory::identity::BoardId;
use crate::wifi::EntropyPool;

/// Samples in a turn, which takes 0.1 ms: packs may have to be sampled behind it.
const SAMPLES_IN_A_TURN: usize = 8;

/// 32 bytes that can't be guessed; `None` if the oscillator gives none.
pub async fn entropy(board_id: Option<BoardId>) -> Option<[u8; 32]> {
    let mut pool = EntropyPool::new();
    for byte in board_id.iter().flat_map(|id| id.0) {
        pool.mix(&[byte.into()]);
    }
    while !pool.is_full() {
        for _ in 0..SAMPLES_IN_A_TURN {
            asm::delay(pool.next_pause_cycles());
            pool.add(pac::ROSC.randombit().read().randombit());
        }
        // When the other tasks left the processor, and the noise of the last conversion.
        pool.mix(&[pac::TIMER.timerawl().read(), pac::ADC.result().read().0]);
        yield_now().await;
    }
    pool.finish()
}
