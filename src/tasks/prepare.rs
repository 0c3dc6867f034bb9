//! Erases flash ahead of need.

use embedded_storage_async::nor_flash::NorFlash;

use super::Shared;
use crate::log::warn;
use crate::memory::storage::{Prepared, Storage, Value};

/// Erases the sector that `storage` needs next, unless the vehicle is armed: a block at each turn at the flash.
pub(super) async fn prepare<F: NorFlash, V: Value>(storage: &mut Storage<F, V>, shared: &Shared) {
    loop {
        // Looking for what is erased takes longer than a sample may be late.
        shared.away_from_sampling().await;
        let _turn = shared.flash_turn().await;
        match storage.prepare(&|| shared.may_erase()).await {
            Ok(Prepared::Partly) => {}
            Ok(Prepared::AsFarAsPossible) => return,
            Err(error) => {
                warn!("storage: no sector erased ahead: {:?}", error);
                return;
            }
        }
    }
}
