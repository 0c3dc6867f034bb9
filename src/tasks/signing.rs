//! Keeps the signing key, and the time signatures have reached, in flash.

use embassy_time::{Duration, Instant, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::storage::RETRY_INTERVAL;
use super::{Shared, mark};
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::mavlink::dialect::MavSeverity;
use crate::mavlink::{Signing, SigningChange, SigningTrouble, StoredSigning, ToStore};
use crate::storage::{Storage, StorageError};

/// How often the time is looked at. It is written down once a minute.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);

/// What of signing is in flash, and the flash.
pub struct SigningStorage<F> {
    storage: Storage<F>,
    stored: StoredSigning,
}

impl<F: NorFlash> SigningStorage<F> {
    /// Reads what there is. What can't be read counts as a lost key: [`Signing::trouble`] reports it.
    pub async fn load(storage: Storage<F>) -> (Self, Signing) {
        let mut this = Self {
            storage,
            stored: StoredSigning::default(),
        };
        let stored = &mut this.stored;
        let read = this.storage.load(&mut |key, word| stored.found(key, word)).await;
        if let Err(error) = read {
            warn!("signing storage: {:?}", error);
        }
        let mut signing = this.stored.restore(this.storage.condition());
        // Before the first frame leaves: what is signed from now on must not be signed again after the next start.
        if let Some(what) = signing.next_unsaved(Instant::now().as_micros()) {
            match this.store(&what).await {
                Ok(()) => signing.mark_saved(&what),
                Err(_) => signing.mark_failed(),
            }
        }
        (this, signing)
    }

    async fn store(&mut self, what: &ToStore) -> Result<(), StorageError> {
        if *what == ToStore::Nothing {
            self.storage.start_over().await?;
            self.stored = StoredSigning::default();
        }
        for (key, word) in self.stored.words(what) {
            self.storage.store(key, word).await?;
            self.stored.found(key, word);
        }
        Ok(())
    }
}

/// Logs that the key was lost. Ground stations that connect are informed while that lasts.
pub fn report_signing(shared: &Shared) {
    if shared.with_signing(|signing| signing.has_lost_key()) {
        warn!("{}", SigningTrouble::KeyLost.text());
    }
}

/// Writes another key to flash as soon as it was set up, and the time now and then.
///
/// A change is announced when it is in flash. While it can't be written, that is announced at each attempt.
pub async fn keep_signing<F: NorFlash>(
    mut storage: SigningStorage<F>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let mut retry_at = Instant::MIN;
    let mut to_announce: Option<SigningChange> = None;
    loop {
        mark(check_in);
        let asked = with_timeout(LOOK_INTERVAL, shared.to_save_signing.wait()).await;
        if asked.is_err() && Instant::now() < retry_at {
            continue;
        }
        to_announce = asked.ok().or(to_announce);
        if save(&mut storage, shared, check_in).await.is_err() {
            retry_at = Instant::now() + RETRY_INTERVAL;
            shared.announce(
                MavSeverity::MAV_SEVERITY_CRITICAL,
                SigningTrouble::NotSaved.text(),
            );
        } else if let Some(change) = to_announce.take() {
            info!("signing: {:?} saved", change);
            shared.announce(MavSeverity::MAV_SEVERITY_INFO, change.text());
        }
    }
}

/// Writes what waits. After a failure it starts again once, in the next sector; what was there does not count any more.
async fn save<F: NorFlash>(
    storage: &mut SigningStorage<F>,
    shared: &Shared,
    check_in: &CheckIn,
) -> Result<(), StorageError> {
    let mut first_error = None;
    loop {
        let now_us = Instant::now().as_micros();
        let Some(what) = shared.with_signing(|signing| signing.next_unsaved(now_us)) else {
            return Ok(());
        };
        match storage.store(&what).await {
            Ok(()) => shared.with_signing(|signing| signing.mark_saved(&what)),
            Err(error) => {
                warn!("signing storage: {:?}", error);
                shared.with_signing(Signing::mark_failed);
                if first_error.replace(error).is_some() {
                    return Err(error);
                }
            }
        }
        mark(check_in);
    }
}
