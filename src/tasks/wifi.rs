//! Keeps names and passwords of Wi-Fi networks in flash.

use embassy_time::{Duration, Timer, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::prepare::prepare;
use super::{CheckIn, Shared, mark, now};
use crate::log::warn;
use crate::memory::storage::{Storage, StorageError};
use crate::wifi::{StoredWifi, WIFI_WORDS, WifiRecord};

/// The telemetry port's first messages leave before the radio begins.
const START_DELAY: Duration = Duration::from_millis(50);

/// How often the task is seen while there is nothing to do.
const IDLE_CHECK: Duration = Duration::from_secs(1);

/// What is stored. What can't be read is as if it was never set.
async fn load<F: NorFlash>(storage: &mut Storage<F, [u32; WIFI_WORDS]>) -> StoredWifi {
    let mut stored = StoredWifi::default();
    let read = storage.load(&mut |key, words| stored.found(key, &words)).await;
    if let Err(error) = read {
        warn!("Wi-Fi storage: {:?}", error);
    }
    stored
}

/// Reads what is stored, and writes what is set up. `entropy` gives 32 random bytes for the first password.
pub async fn keep_wifi<F: NorFlash>(
    mut storage: Storage<F, [u32; WIFI_WORDS]>,
    entropy: impl FnOnce() -> Option<[u8; 32]>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    mark(check_in);
    Timer::after(START_DELAY).await;
    let stored = load(&mut storage).await;
    shared.with(|autopilot| autopilot.wifi_loaded(stored, entropy, now()));
    loop {
        mark(check_in);
        while let Some(record) = shared.with(|autopilot| autopilot.next_unsaved_wifi(now())) {
            let written = write(&record, &mut storage, shared).await;
            shared.with(|autopilot| autopilot.wifi_written(&record, written, now()));
            mark(check_in);
        }
        prepare(&mut storage, shared).await;
        // With or without a request: a retry may be due.
        let _ = with_timeout(IDLE_CHECK, shared.to_save_wifi.wait()).await;
    }
}

async fn write<F: NorFlash>(
    record: &WifiRecord,
    storage: &mut Storage<F, [u32; WIFI_WORDS]>,
    shared: &Shared,
) -> Result<(), StorageError> {
    let _turn = shared.flash_turn().await;
    let may_erase = || shared.may_erase();
    let stored = storage.store(record.key(), record.to_words(), &may_erase).await;
    stored.map(drop)
}
