//! Keeps the signing key, and the time signatures have reached, in flash.

use embassy_time::{Duration, Instant, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::storage::RETRY_INTERVAL;
use super::{Shared, mark};
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::mavlink::dialect::MavSeverity;
use crate::mavlink::{Signing, StoredSigning, ToStore};
use crate::storage::{Storage, StorageError};

/// How often the time is looked at. It is written down at most twice a minute.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);

/// What of signing is in flash, and the flash.
pub struct SigningStorage<F> {
    storage: Storage<F>,
    stored: StoredSigning,
}

impl<F: NorFlash> SigningStorage<F> {
    /// Reads what there is.
    ///
    /// A key that can't be read is told by [`Signing::has_lost_key`]; what stands in flash that signing has never used is
    /// of no interest.
    pub async fn load(mut storage: Storage<F>) -> (Self, Signing) {
        let mut stored = StoredSigning::default();
        let read = storage.load(&mut |key, word| stored.found(key, word)).await;
        if let Err(error) = read {
            warn!("signing storage: {:?}", error);
        }
        let mut signing = stored.restore(read);
        let mut this = Self { storage, stored };
        // Before the first frame leaves: what is signed from now on must not be signed again after the next start.
        if let Some(what) = signing.next_unsaved(Instant::now().as_micros()) {
            match this.store(&what).await {
                Ok(()) => signing.mark_saved(&what),
                Err(error) => warn!("signing storage: {:?}", error),
            }
        }
        (this, signing)
    }

    async fn store(&mut self, what: &ToStore) -> Result<(), StorageError> {
        for (key, word) in self.stored.words(what) {
            self.storage.store(key, word).await?;
            self.stored.found(key, word);
        }
        Ok(())
    }
}

/// Tells ground stations and the log if the key was lost.
pub fn report_signing(shared: &Shared) {
    if shared.with_signing(|signing| signing.has_lost_key()) {
        warn!("the signing key is damaged");
        shared.notice(
            MavSeverity::MAV_SEVERITY_CRITICAL,
            "Signing key damaged: set it up again by USB",
        );
    }
}

/// Writes another key to flash as soon as it was set up, and the time now and then.
pub async fn keep_signing<F: NorFlash>(
    mut storage: SigningStorage<F>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let mut retry_at = Instant::MIN;
    loop {
        mark(check_in);
        let asked = with_timeout(LOOK_INTERVAL, shared.to_save_signing.wait())
            .await
            .is_ok();
        if !asked && Instant::now() < retry_at {
            continue;
        }
        if let Err(error) = save(&mut storage, shared, check_in).await {
            warn!("signing storage: {:?}", error);
            retry_at = Instant::now() + RETRY_INTERVAL;
        }
    }
}

async fn save<F: NorFlash>(
    storage: &mut SigningStorage<F>,
    shared: &Shared,
    check_in: &CheckIn,
) -> Result<(), StorageError> {
    loop {
        let now_us = Instant::now().as_micros();
        let Some(what) = shared.with_signing(|signing| signing.next_unsaved(now_us)) else {
            return Ok(());
        };
        storage.store(&what).await?;
        shared.with_signing(|signing| signing.mark_saved(&what));
        match what {
            ToStore::Key(_) | ToStore::NoKey => info!("signing key saved"),
            // It would fill the log.
            ToStore::Mark(_) => {}
        }
        mark(check_in);
    }
}
