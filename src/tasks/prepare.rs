//! Erases flash ahead of need.

use embedded_storage_async::nor_flash::NorFlash;

use super::Shared;
use crate::log::warn;
use crate::storage::{Storage, Value};

/// Erases the sector that `storage` needs next, unless the vehicle is armed.
pub(super) async fn prepare<F: NorFlash, V: Value>(storage: &mut Storage<F, V>, shared: &Shared) {
    let _turn = shared.flash_turn().await;
    if let Err(error) = storage.prepare(&|| shared.may_erase()).await {
        warn!("storage: no sector erased ahead: {:?}", error);
    }
}
