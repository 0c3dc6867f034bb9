//! Operations in flash, one store after the other, and their retries and announcements; the log.

use core::mem;

use super::announcement::Notice;
use super::recording::{LogStep, Subject};
use super::stores::{FlashJob, FlashResult, FlashStore, PackIdentity};
use super::{Autopilot, Work};
use crate::crash::{Interruption, RunEnd};
use crate::log::{info, warn};
use crate::mavlink::{AcceptUnsigned, LinkKind, SigningChange, SigningTrouble, ToStore};
use crate::memory::save_state::SaveState;
use crate::memory::storage::{Erase, StorageError};
use crate::parameter::Unsaved;
use crate::recorder::{Erasure, LogFile, Piece, Ring};
use crate::system::LogReader;
use crate::time::Instant;
use crate::vehicle::ArmState;

impl Autopilot {
    /// The next operation of `store` at `now`; `None` while a failed one waits for its retry.
    pub fn next_flash_job(&mut self, store: FlashStore, now: Instant) -> Option<FlashJob> {
        let retry = self.save_states[store as usize].take_retry(now);
        match store {
            FlashStore::Parameters => {
                if retry {
                    self.parameters.retry_failed();
                }
                self.next_unsaved_parameter(now).map(FlashJob::Parameter)
            }
            FlashStore::Signing => {
                if retry {
                    self.save_states[store as usize] = SaveState::New;
                }
                self.next_unsaved_signing(now).map(FlashJob::Signing)
            }
            FlashStore::Learnt => self.next_learnt_job(),
            FlashStore::Wifi => self.next_unsaved_wifi().map(FlashJob::Wifi),
        }
    }

    /// Takes the result of an operation. A failed write is repeated after a minute.
    pub fn flash_done(&mut self, job: &FlashJob, result: FlashResult, now: Instant) {
        match (job, result) {
            (FlashJob::ReadLearnt(identity), stored) => self.learnt_read(*identity, stored),
            (_, Ok(_)) => self.written(job),
            (_, Err(error)) => self.write_failed(job, error, now),
        }
    }

    fn written(&mut self, job: &FlashJob) {
        match job {
            FlashJob::Parameter(unsaved) => {
                match unsaved {
                    Unsaved::Reset => info!("stored parameters cleared"),
                    Unsaved::Value(id, _) => info!("{} saved", id.name().as_str()),
                }
                self.parameters.mark_saved(*unsaved);
            }
            FlashJob::Signing(unsaved) => self.signing.mark_saved(unsaved),
            FlashJob::WriteLearnt(PackIdentity { pack, .. }, learnt) => {
                info!("battery {}: learnt data saved", pack.number());
                self.save_states[FlashStore::Learnt as usize] = SaveState::Saved;
                self.packs.bank.get_mut(*pack).0.mark_learnt_saved(learnt);
            }
            FlashJob::Wifi(record) => {
                info!("Wi-Fi settings saved");
                self.save_states[FlashStore::Wifi as usize] = SaveState::Saved;
                self.wifi.credentials.mark_saved(record);
            }
            FlashJob::ReadLearnt(_) => {}
        }
    }

    fn write_failed(&mut self, job: &FlashJob, error: StorageError, now: Instant) {
        let store = job.store();
        // To wait until the vehicle is disarmed is not a fault.
        match error {
            StorageError::NoErasedSpace => info!("{} not saved until disarmed", store.content()),
            error => warn!("{} not saved: {:?}", store.content(), error),
        }
        let state = &mut self.save_states[store as usize];
        let is_repeated = state.failure().is_some();
        let to_announce = state.fail(error, now);
        match job {
            FlashJob::Parameter(unsaved) => {
                if let Some(error) = self.parameters.mark_failed(*unsaved, error) {
                    self.save_reports.add(error, now);
                }
            }
            FlashJob::Signing(_) => self.signing_failed(error, is_repeated, now),
            FlashJob::ReadLearnt(_) | FlashJob::WriteLearnt(..) | FlashJob::Wifi(_) => {
                if let Some(error) = to_announce {
                    self.announce(&Notice::NotSaved(store, error), now);
                }
            }
        }
    }

    /// The last failure of a store, until a write succeeds.
    pub(super) fn save_failure(&self, store: FlashStore) -> Option<StorageError> {
        self.save_states[store as usize].failure()
    }

    /// Whether a failed write of a store waits for its retry.
    pub(super) fn waits_for_retry(&self, store: FlashStore) -> bool {
        self.save_states[store as usize].is_waiting()
    }

    /// Tries again at once to write to a store, if that has failed.
    pub(super) fn retry_store(&mut self, store: FlashStore) {
        self.save_states[store as usize].retry();
    }

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
            // The disarming may have waited.
            self.work |= Work::LOG;
        }
    }

    /// The vehicle was disarmed: saves what has waited for erased space, and has it erased ahead for the next drive. Not before
    /// the watchdog permits an erase.
    pub(super) fn save_after_disarming(&mut self) {
        if self.waits_for_watchdog() {
            return;
        }
        self.save_states[FlashStore::Signing as usize] = SaveState::New;
        self.retry_failed();
        self.follow_wifi_parameters();
    }

    /// Tries again what could not be saved, but for the signing key.
    fn retry_failed(&mut self) {
        self.parameters.retry_failed();
        self.retry_store(FlashStore::Learnt);
        self.retry_store(FlashStore::Wifi);
        self.work |= Work::SAVE;
    }

    /// The parameter to write to flash next. A value is live and acknowledged before it is written.
    fn next_unsaved_parameter(&mut self, now: Instant) -> Option<Unsaved> {
        if let Some(error) = self.save_reports.take(now) {
            self.report_unsaved(error, now);
        }
        let unsaved = self.parameters.next_unsaved();
        if unsaved.is_none() && self.parameters.save_failure().is_none() && self.save_reports.take_recovery()
        {
            self.announce(&Notice::ParametersSaved, now);
        }
        unsaved
    }

    /// Announces that parameters can't be saved, unless they were by now, or are about to be.
    fn report_unsaved(&mut self, error: StorageError, now: Instant) {
        if error == StorageError::NoErasedSpace && self.may_erase() == Erase::Allowed {
            return;
        }
        if let Some(failure) = self.parameters.unsaved_by(error) {
            self.announce(&failure, now);
            self.save_reports.mark_announced();
        }
    }

    /// The signing data to write to flash next: a key as soon as it was set up, and the time once a minute.
    fn next_unsaved_signing(&mut self, now: Instant) -> Option<ToStore> {
        if self.waits_for_retry(FlashStore::Signing) {
            return None;
        }
        let armed_us = self.armed_us(now);
        let unsaved = self.signing.next_unsaved(now, armed_us);
        if unsaved.is_none() {
            self.save_states[FlashStore::Signing as usize] = SaveState::Saved;
            if let Some(change) = self.signing_change.take() {
                self.announce(&change, now);
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

    /// After a failure everything is written once more at once, to the next sector.
    fn signing_failed(&mut self, error: StorageError, is_repeated: bool, now: Instant) {
        if error == StorageError::NoErasedSpace {
            // Flash holds the same data as before.
            return;
        }
        self.signing.mark_failed();
        if is_repeated {
            self.announce(&SigningTrouble::NotSaved, now);
        } else {
            self.retry_store(FlashStore::Signing);
        }
    }

    pub(super) fn save_signing(&mut self, change: SigningChange) {
        self.signing_change = Some(change);
        self.save_states[FlashStore::Signing as usize] = SaveState::New;
        self.work |= Work::SAVE;
    }

    /// The newest log ends while armed.
    pub fn last_run_ended_armed(&mut self, now: Instant) {
        if self.last_run.end == RunEnd::Unknown {
            self.last_run.end = RunEnd::Interrupted(Interruption::PowerOff);
            self.announce(&Notice::PowerWentOff, now);
        }
    }

    /// The logs in flash were looked for. Nothing is recorded before. Returns the one that has to show how the last run ended.
    pub fn logs_found(&mut self, ring: Ring) -> Option<LogFile> {
        let newest = ring.newest();
        self.recording.found(ring);
        newest.filter(|_| self.last_run.end == RunEnd::Unknown)
    }

    /// Place of a log's bytes from `offset` on; `None` if it has none.
    pub fn log_piece(&self, number: u16, offset: u32) -> Option<Piece> {
        self.recording.locate(number, offset)
    }

    /// The next flash operation of the log at `now`, if there is one.
    pub fn next_log_step(&mut self, now: Instant) -> Option<LogStep> {
        let may_erase = self.may_erase();
        let subject = Subject {
            board_id: self.identity().board_id,
            packs: &self.packs,
            parameters: &self.parameters,
        };
        self.recording.next_step(now, &subject, may_erase)
    }

    /// The outcome of programming a page.
    pub fn log_written(&mut self, outcome: Result<(), ()>, now: Instant) {
        self.recording.written(outcome, now);
    }

    /// The outcome of an erase.
    pub fn log_erased(&mut self, erasure: Erasure, outcome: Result<(), ()>) {
        self.recording.erased(erasure, outcome);
    }

    /// The place in flash of a log's bytes from `offset` on, to be read at `now` by `reader`, for which the file is kept from now
    /// on. `None` if it has no such bytes, or there are too many readers.
    pub fn locate_log(&mut self, number: u16, offset: u32, reader: LogReader, now: Instant) -> Option<Piece> {
        let is_kept = self.recording.readers.note(reader, number, now);
        is_kept.then(|| self.recording.locate(number, offset)).flatten()
    }

    /// A download is complete.
    pub fn log_download_ended(&mut self, reader: LogReader) {
        self.recording.readers.end(reader);
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
            self.announce(&SigningTrouble::NotSaved, now);
        }
    }

    /// Whether a value that was set or learnt still has to be written to flash. What could not be written and waits for its retry
    /// does not count.
    pub fn has_unsaved(&self) -> bool {
        self.signing.is_key_unsaved()
            || self.parameters.next_unsaved().is_some()
            || self.next_unsaved_learnt().is_some()
            || self.next_unsaved_wifi().is_some()
            || !self.recording.is_written()
    }
}
