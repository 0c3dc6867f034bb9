//! Keeps the signing key, and the time signatures have reached, in flash.

use embassy_time::{Duration, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::prepare::prepare;
use super::{CheckIn, Shared, mark, now};
use crate::log::warn;
use crate::mavlink::{Signing, StoredSigning, ToStore};
use crate::memory::storage::{Erase, MayErase, Storage, StorageError};

/// How often the time is looked at. It is written down once a minute.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);

/// Time armed so far, before the tasks start.
const NOT_ARMED_US: u64 = 0;

/// What of signing is in flash, and the flash.
pub struct SigningStorage<F> {
    storage: Storage<F>,
    stored: StoredSigning,
}

impl<F: NorFlash> SigningStorage<F> {
    /// Reads what there is into `signing`. What can't be read counts as a lost key: [`Signing::trouble`] reports it.
    pub async fn load(storage: Storage<F>, signing: &mut Signing) -> Self {
        let mut this = Self {
            storage,
            stored: StoredSigning::default(),
        };
        let stored = &mut this.stored;
        let read = this.storage.load(&mut |key, word| stored.found(key, word)).await;
        if let Err(error) = read {
            warn!("signing storage: {:?}", error);
        }
        *signing = this.stored.restore(this.storage.condition());
        // Before the first frame leaves: what is signed from now on must not be signed again after the next start.
        if let Some(what) = signing.next_unsaved(now(), NOT_ARMED_US) {
            match this.store(&what, &Erase::always).await {
                Ok(()) => signing.mark_saved(&what),
                Err(_) => signing.mark_failed(),
            }
        }
        this
    }

    async fn store(&mut self, what: &ToStore, may_erase: MayErase<'_>) -> Result<(), StorageError> {
        if *what == ToStore::Nothing {
            self.storage.start_over(may_erase).await?;
            self.stored = StoredSigning::default();
        }
        for (key, word) in self.stored.words(what) {
            self.storage.store(key, word, may_erase).await?;
            self.stored.found(key, word);
        }
        Ok(())
    }
}

/// Writes another key to flash as soon as it was set up, and the time now and then.
pub async fn keep_signing<F: NorFlash>(
    mut storage: SigningStorage<F>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    loop {
        mark(check_in);
        prepare(&mut storage.storage, shared).await;
        // With or without a request: the time has to be written, or a retry may be due.
        let _ = with_timeout(LOOK_INTERVAL, shared.to_save_signing.wait()).await;
        while let Some(unsaved) = shared.with(|autopilot| autopilot.next_unsaved_signing(now())) {
            let turn = shared.flash_turn().await;
            let result = storage.store(&unsaved, &|| shared.may_erase()).await;
            drop(turn);
            shared.with(|autopilot| {
                autopilot.signing_written(&unsaved, result, now());
            });
            mark(check_in);
        }
    }
}
