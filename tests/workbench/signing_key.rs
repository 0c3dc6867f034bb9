//! A board whose flash holds a signing key.

use std::sync::OnceLock;

use embassy_futures::block_on;
use rover_battmon::mavlink::{SigningKey, StoredSigning, ToStore};
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon_tools::sim::SimulatedFlash;

use crate::bench::{Bench, DIVIDER_CODE, SECOND, SIGNING_OFFSET};

pub use support::signer::{OWNER, STRANGER};

/// The words that signing stores for the owner's key.
pub fn words_of_key() -> Vec<(u16, u32)> {
    let key = SigningKey::new([OWNER; 32]).expect("not all zeros");
    let words = StoredSigning::default().words(&ToStore::Key(key));
    words.into_iter().collect()
}

/// The flash of signing after these words were stored.
pub fn flash_with(words: impl IntoIterator<Item = (u16, u32)>) -> Vec<u8> {
    let flash = SimulatedFlash::blank();
    let mut storage = Storage::new(flash.clone(), flash_map::SIGNING);
    block_on(async {
        for (key, word) in words {
            let stored = storage.store(key, word, &Erase::always).await;
            stored.expect("a sound flash");
        }
        storage.prepare(&Erase::always).await.expect("a sound flash");
    });
    flash.content(flash_map::SIGNING)
}

/// The flash of a board whose owner has set up a key.
pub fn flash_with_key() -> &'static [u8] {
    static FLASH: OnceLock<Vec<u8>> = OnceLock::new();
    FLASH.get_or_init(|| flash_with(words_of_key()))
}

/// Such a board, which has run for a second.
pub fn protected() -> Bench {
    let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, SIGNING_OFFSET, flash_with_key());
    bench.run_for(SECOND);
    bench
}
