//! What has to be written to flash: parameters, the signing key and the log. What is learnt of the packs: [`super::learnt`]; of
//! Wi-Fi: [`super::wifi`].

use core::mem;

use super::announcement::Announcement;
use super::recording::{LogStep, Subject};
use super::{Autopilot, Work};
use crate::log::{info, warn};
use crate::mavlink::{AcceptUnsigned, LinkKind, SigningChange, SigningTrouble, ToStore};
use crate::memory::save_state::SaveState;
use crate::memory::storage::{Erase, StorageError};
use crate::parameter::Unsaved;
use crate::recorder::{Erasure, FlashOutcome, Piece, Ring};
use crate::time::Instant;
use crate::vehicle::ArmState;

impl Autopilot {
    /// Whether flash may be erased now. That stops everything for up to 400 ms, which must not happen to a rover that may be
    /// moving, nor under the watchdog of one.
    pub fn may_erase(&self) -> Erase {
        match (self.vehicle.arm_state(), self.watched_as) {
            (ArmState::Disarmed, ArmState::Disarmed) => Erase::Allowed,
            _ => Erase::Forbidden,
        }
    }

    /// Whether flash has to be left alone until the watchdog has the time-out of a disarmed vehicle: what needs an erase
    /// would be refused as it is while armed, and reported as that.
    pub fn waits_for_watchdog(&self) -> bool {
        self.vehicle.arm_state() == ArmState::Disarmed && self.watched_as == ArmState::Armed
    }

    /// The watchdog was fed with the time-out of this state. Without a watchdog this is never called.
    pub fn watched(&mut self, as_state: ArmState) {
        let before = mem::replace(&mut self.watched_as, as_state);
        if (before, as_state) == (ArmState::Armed, ArmState::Disarmed) {
            self.save_after_disarming();
        }
    }

    /// The vehicle was disarmed: saves what has waited for erased space, and has it erased ahead for the next drive. Not before
    /// the watchdog permits an erase.
    pub(super) fn save_after_disarming(&mut self) {
        if self.waits_for_watchdog() {
            return;
        }
        self.signing_save = SaveState::New;
        self.retry_failed();
        self.follow_wifi_parameters();
    }

    /// Tries again what could not be saved, but for the signing key.
    fn retry_failed(&mut self) {
        self.parameters.retry_failed();
        self.learnt_save.retry();
        self.wifi.save.retry();
        self.work |= Work::SAVE;
    }

    /// The parameter to write to flash next. A value is live and acknowledged before it is written.
    pub fn next_unsaved_parameter(&mut self, now: Instant) -> Option<Unsaved> {
        if self.parameter_save.take_retry(now) {
            self.parameters.retry_failed();
        }
        if let Some(error) = self.save_reports.take(now) {
            self.report_unsaved(error, now);
        }
        let unsaved = self.parameters.next_unsaved();
        if unsaved.is_none() && self.parameters.save_failure().is_none() && self.save_reports.take_recovery()
        {
            self.announce(Announcement::ParametersSaved, now);
        }
        unsaved
    }

    /// Announces that parameters can't be saved, unless they were by now, or are about to be.
    fn report_unsaved(&mut self, error: StorageError, now: Instant) {
        if error == StorageError::NoErasedSpace && self.may_erase() == Erase::Allowed {
            return;
        }
        if let Some(failure) = self.parameters.unsaved_by(error) {
            self.announce(Announcement::ParametersNotSaved(failure), now);
            self.save_reports.mark_announced();
        }
    }

    /// Result of writing `unsaved`.
    pub fn parameter_written(&mut self, unsaved: Unsaved, result: Result<(), StorageError>, now: Instant) {
        match (result, unsaved) {
            (Ok(()), Unsaved::Reset) => info!("stored parameters cleared"),
            (Ok(()), Unsaved::Value(id, _)) => info!("{} saved", id.name().as_str()),
            (Err(error), _) => {
                log_failure("parameter", error);
                self.parameter_save.fail(error, now);
                if let Some(error) = self.parameters.mark_failed(unsaved, error) {
                    self.save_reports.add(error, now);
                }
                return;
            }
        }
        self.parameters.mark_saved(unsaved);
    }

    /// The signing data to write to flash next: a key as soon as it was set up, and the time once a minute.
    pub fn next_unsaved_signing(&mut self, now: Instant) -> Option<ToStore> {
        if self.signing_save.take_retry(now) {
            self.signing_save = SaveState::New;
        }
        if self.signing_save.is_waiting() {
            return None;
        }
        let armed_us = self.armed_us(now);
        let unsaved = self.signing.next_unsaved(now, armed_us);
        if unsaved.is_none() {
            self.signing_save = SaveState::Saved;
            if let Some(change) = self.signing_change.take() {
                self.announce(Announcement::SigningSaved(change), now);
            }
        }
        unsaved
    }

    /// For how long the vehicle has been armed at `now`; 0 if it is not.
    fn armed_us(&mut self, now: Instant) -> u64 {
        match self.vehicle.arm_state() {
            ArmState::Armed => now.us_since(*self.armed_since.get_or_insert(now)),
            ArmState::Disarmed => {
                self.armed_since = None;
                0
            }
        }
    }

    /// Result of writing `unsaved`. After a failure everything is written once more at once, to the next sector.
    pub fn signing_written(&mut self, unsaved: &ToStore, result: Result<(), StorageError>, now: Instant) {
        let Err(error) = result else {
            self.signing.mark_saved(unsaved);
            return;
        };
        log_failure("signing", error);
        let was_repeated = self.signing_save.failure().is_some();
        self.signing_save.fail(error, now);
        if error == StorageError::NoErasedSpace {
            // What is in flash is as good as before.
            return;
        }
        self.signing.mark_failed();
        if was_repeated {
            self.announce(Announcement::Signing(SigningTrouble::NotSaved), now);
        } else {
            self.signing_save.retry();
        }
    }

    pub(super) fn save_signing(&mut self, change: SigningChange) {
        self.signing_change = Some(change);
        self.signing_save = SaveState::New;
        self.work |= Work::SAVE;
    }

    /// The logs in flash were looked for. Nothing is recorded before.
    pub fn logs_found(&mut self, ring: Ring) {
        self.recording.found(ring);
    }

    /// What the flash has to do next for the log at `now`, if anything.
    pub fn next_log_step(&mut self, now: Instant) -> Option<LogStep> {
        let may_erase = self.may_erase();
        let subject = Subject {
            board_id: self.identity.board_id,
            packs: &self.packs,
            parameters: &self.parameters,
        };
        self.recording.next_step(now, &subject, may_erase)
    }

    /// The outcome of programming a page.
    pub fn log_written(&mut self, outcome: FlashOutcome, now: Instant) {
        self.recording.written(outcome, now);
    }

    /// The outcome of an erase.
    pub fn log_erased(&mut self, erasure: Erasure, outcome: FlashOutcome) {
        self.recording.erased(erasure, outcome);
    }

    /// The place in flash of a log's bytes from `offset` on, to be read at `now` for the link of this number, or for a browser's
    /// download.
    pub fn locate_log(&mut self, number: u16, offset: u32, link: Option<u16>, now: Instant) -> Option<Piece> {
        self.recording.readers.note(link, now);
        self.recording.locate(number, offset)
    }

    /// A browser's download is complete.
    pub fn browser_download_ended(&mut self) {
        self.recording.readers.browser_ended();
    }

    /// Whether logs are listed and read on a link of this kind without a signature.
    pub fn permits_unsigned_reads(&self, link: LinkKind) -> bool {
        let accepted = AcceptUnsigned::on(link, &self.parameters);
        self.signing.permits_unsigned_reads(accepted)
    }

    /// Before a restart: what could not be saved has a last chance, and a signing key that is not saved is announced.
    pub fn prepare_restart(&mut self, now: Instant) {
        self.retry_failed();
        if self.signing.trouble() == Some(SigningTrouble::NotSaved) {
            self.announce(Announcement::Signing(SigningTrouble::NotSaved), now);
        }
    }

    /// Whether a value that was set or learnt still has to be written to flash. What could not be written and waits for its retry
    /// does not count.
    pub fn has_unsaved(&self) -> bool {
        self.signing.is_key_unsaved()
            || self.parameters.next_unsaved().is_some()
            || self.next_unsaved_learnt().is_some()
            || self.wifi.next_unsaved().is_some()
            || !self.recording.is_written()
    }
}

/// Logs why something was not written: to wait until the vehicle is disarmed is not a fault.
pub(super) fn log_failure(storage: &str, error: StorageError) {
    match error {
        StorageError::NoErasedSpace => info!("{} storage: no erased space until disarmed", storage),
        error => warn!("{} storage: {:?}", storage, error),
    }
}
