//! What has to be written to flash: parameters and the signing key. What is learnt of the packs: [`super::learnt`].

use super::announcement::Announcement;
use super::autopilot::Autopilot;
use super::signing_save::Attempt;
use super::work::Work;
use crate::log::{info, warn};
use crate::mavlink::{SigningChange, SigningTrouble, ToStore};
use crate::parameter::{SAVE_RETRY_INTERVAL_US, Unsaved};
use crate::storage::StorageError;
use crate::time::Instant;

impl Autopilot {
    /// The parameter to write to flash next. A value is live and acknowledged before it is written.
    pub fn next_unsaved_parameter(&mut self, now: Instant) -> Option<Unsaved> {
        if self.save_failures.take_retry(now) {
            self.parameters.retry_failed();
        }
        if let Some(error) = self.save_failures.take_report(now) {
            self.announce(Announcement::ParametersNotSaved(error));
        }
        self.parameters.next_unsaved()
    }

    /// Result of writing `unsaved`.
    pub fn parameter_written(&mut self, unsaved: Unsaved, result: Result<(), StorageError>, now: Instant) {
        match (result, unsaved) {
            (Ok(()), Unsaved::Reset) => info!("stored parameters cleared"),
            (Ok(()), Unsaved::Value(id, _)) => info!("{} saved", id.name().as_str()),
            (Err(error), _) => {
                warn!("parameter storage: {:?}", error);
                let report = self.parameters.mark_failed(unsaved, error);
                self.save_failures.add(report, now);
                return;
            }
        }
        self.parameters.mark_saved(unsaved);
    }

    /// The signing data to write to flash next: a key as soon as it was set up, and the time once a minute.
    pub fn next_unsaved_signing(&mut self, now: Instant) -> Option<ToStore> {
        if now < self.signing_save.retry_at {
            return None;
        }
        let unsaved = self.signing.next_unsaved(now);
        if unsaved.is_none() {
            self.signing_save.attempt = Attempt::First;
            if let Some(change) = self.signing_save.change.take() {
                self.announce(Announcement::SigningSaved(change));
            }
        }
        unsaved
    }

    /// Result of writing `unsaved`. After a failure everything is written once more, to the next sector.
    pub fn signing_written(&mut self, unsaved: &ToStore, result: Result<(), StorageError>, now: Instant) {
        let Err(error) = result else {
            self.signing.mark_saved(unsaved);
            return;
        };
        warn!("signing storage: {:?}", error);
        self.signing.mark_failed();
        match self.signing_save.attempt {
            Attempt::First => self.signing_save.attempt = Attempt::Second,
            Attempt::Second => {
                self.signing_save.attempt = Attempt::First;
                self.signing_save.retry_at = now.after_us(SAVE_RETRY_INTERVAL_US);
                self.announce(Announcement::Signing(SigningTrouble::NotSaved));
            }
        }
    }

    pub(super) fn save_signing(&mut self, change: SigningChange) {
        self.signing_save.change = Some(change);
        self.signing_save.retry_at = Instant::EPOCH;
        self.work |= Work::SAVE_SIGNING;
    }

    /// Before a restart: what could not be saved has a last chance, and a signing key that is not saved is announced.
    pub fn prepare_restart(&mut self) {
        self.parameters.retry_failed();
        self.work |= Work::SAVE_PARAMETERS;
        self.retry_learnt();
        if self.signing.trouble() == Some(SigningTrouble::NotSaved) {
            self.announce(Announcement::Signing(SigningTrouble::NotSaved));
        }
    }

    /// Whether a value that was set or learnt still has to be written to flash. What could not be written and waits for its retry
    /// does not count.
    pub fn has_unsaved(&self) -> bool {
        self.signing.is_key_unsaved()
            || self.parameters.next_unsaved().is_some()
            || self.next_unsaved_learnt().is_some()
    }
}
