//! What makes the live values doubtful, and what ends that.
//!
//! What was damaged or half loaded leaves a mark in flash, under the key of `PARAM_CHECKED`: stored before any other value, and taken
//! back after all of them. What does not fit needs none: the value stays stored under its key until the parameter is set.

use super::trouble::{CHECKED, Doubts};
use super::{Access, Bearing, ParameterId, ParameterTrouble, Parameters, Refused};
use crate::memory::save_state::SaveState;

impl Parameters {
    /// Marks the values in flash as not read, until the next start: every value that is set has to be saved, even one that equals
    /// the default.
    pub fn mark_not_read(&mut self) {
        self.doubts |= Doubts::NOT_READ;
    }

    /// Marks the values in flash as damaged, until the owner has confirmed those that are left.
    pub fn mark_damaged(&mut self) {
        self.set_doubts(self.doubts | Doubts::DAMAGED);
    }

    /// As [`set`](Self::set), by a file: until [`end_file`](Self::end_file) it counts as half loaded if that changes anything that
    /// bears on the drive.
    ///
    /// # Errors
    /// The value is refused; the old one is kept.
    pub fn set_by_file(&mut self, id: ParameterId, value: f32) -> Result<(), Refused> {
        self.set(id, value)?;
        if id.row().access == Access::Setting(Bearing::Drive) && self.save_states.get(id) != SaveState::Saved
        {
            self.ended -= Doubts::HALF_LOADED;
            self.set_doubts(self.doubts | Doubts::HALF_LOADED);
        }
        Ok(())
    }

    /// A file has come whole.
    pub fn end_file(&mut self) {
        self.end(Doubts::HALF_LOADED);
    }

    /// The owner has checked the values: what is live is to be stored. Without effect while those in flash are not known.
    pub fn confirm(&mut self) {
        if self.doubts.contains(Doubts::NOT_READ) {
            return;
        }
        for id in ParameterId::all() {
            if self.is_misfit(id) {
                self.write(id, self.get(id), SaveState::New);
            }
        }
        self.end(self.doubts);
    }

    /// Cause for which the values may not be the owner's, if there is one.
    pub fn trouble(&self) -> Option<ParameterTrouble> {
        let doubts = self.doubts - self.ended;
        if doubts.contains(Doubts::NOT_READ) {
            return Some(ParameterTrouble::NotRead);
        }
        if doubts == Doubts::HALF_LOADED {
            return Some(ParameterTrouble::HalfLoaded);
        }
        // Or what another version has marked.
        if !doubts.is_empty() {
            return Some(ParameterTrouble::Damaged);
        }
        if self.misfits.is_empty() {
            return None;
        }
        let mut misfits = ParameterId::all().filter(|id| self.is_misfit(*id));
        Some(ParameterTrouble::DoesNotFit {
            first: misfits.next()?,
            more: misfits.count(),
        })
    }

    /// Number of stored values under keys that this firmware does not have. They are kept.
    pub fn unknown_count(&self) -> u16 {
        self.unknown
    }

    /// Whether the stored value of a parameter in use does not fit, so that the default is live.
    fn is_misfit(&self, id: ParameterId) -> bool {
        self.misfits.contains(id) && self.listed.contains(id)
    }

    /// Takes over the mark that was stored as `value`.
    pub(super) fn restore_mark(&mut self, value: f32) {
        self.doubts |= Doubts::from_bits_retain(value as u8).marked();
    }

    /// What is stored of a parameter: its value, or the mark.
    pub(super) fn to_store(&self, id: ParameterId) -> f32 {
        if id == CHECKED {
            f32::from(self.doubts.marked().bits())
        } else {
            self.get(id)
        }
    }

    fn end(&mut self, ended: Doubts) {
        self.ended |= self.doubts & ended;
        self.take_mark_back();
    }

    /// Takes the mark of what has ended back once everything else is saved.
    pub(super) fn take_mark_back(&mut self) {
        if !self.ended.is_empty() && self.unsaved_count() == 0 {
            self.set_doubts(self.doubts - self.ended);
            self.ended = Doubts::empty();
        }
    }

    fn set_doubts(&mut self, doubts: Doubts) {
        if doubts != self.doubts {
            self.doubts = doubts;
            self.save_states.set(CHECKED, SaveState::New);
        }
    }
}
