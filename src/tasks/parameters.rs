//! Keeps the parameters in flash.

use embassy_time::{Duration, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::prepare::prepare;
use super::{CheckIn, Shared, mark, now};
use crate::memory::storage::{Storage, StorageError};
use crate::parameter::Unsaved;

/// How often the task is seen while there is nothing to save.
const IDLE_CHECK: Duration = Duration::from_secs(1);

/// Writes what was set to flash, and clears it when the parameters were reset.
///
/// A value is live and acknowledged before it is written. Other tasks may run after each operation.
pub async fn keep_parameters<F: NorFlash>(mut storage: Storage<F>, shared: &Shared, check_in: &CheckIn) -> ! {
    loop {
        mark(check_in);
        prepare(&mut storage, shared).await;
        // With or without a request: a retry may be due.
        let _ = with_timeout(IDLE_CHECK, shared.to_save.wait()).await;
        while let Some(unsaved) = shared.with(|autopilot| autopilot.next_unsaved_parameter(now())) {
            let result = write(&mut storage, unsaved, shared).await;
            shared.with(|autopilot| {
                autopilot.parameter_written(unsaved, result, now());
            });
            mark(check_in);
        }
    }
}

async fn write<F: NorFlash>(
    storage: &mut Storage<F>,
    unsaved: Unsaved,
    shared: &Shared,
) -> Result<(), StorageError> {
    let _turn = shared.flash_turn().await;
    let may_erase = || shared.may_erase();
    match unsaved {
        Unsaved::Reset => storage.clear(&may_erase).await,
        Unsaved::Value(id, value) => {
            let stored = storage.store(id.key(), value.to_bits(), &may_erase).await;
            stored.map(drop)
        }
    }
}
