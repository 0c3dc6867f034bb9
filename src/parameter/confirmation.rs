//! Doubts of the live values, and their end.
//!
//! Damaged or half loaded parameters leave a mark in flash, under the key of `PARAM_CHECKED`: stored before any other value, and taken
//! back after all of them. What does not fit needs none: the value stays stored under its key until the parameter is set.

use super::trouble::{CHECKED, Doubts};
use super::{ParameterId, ParameterTrouble, Parameters};

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

    /// A file has set a parameter that bears on the drive: if that has changed it, the file counts as half loaded until
    /// [`end_file`](Self::end_file).
    pub fn set_by_file(&mut self, id: ParameterId) {
        if self.unsaved.contains(id) {
            self.set_doubts((self.doubts - Doubts::ENDED) | Doubts::HALF_LOADED);
        }
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
        let misfits = self.misfits.clone();
        let misfits = ParameterId::all().filter(|id| misfits.contains(*id));
        misfits.for_each(|id| self.mark_unsaved(id));
        self.end(self.doubts);
    }

    /// Cause for which the values may not be the owner's, if there is one.
    pub fn trouble(&self) -> Option<ParameterTrouble> {
        if self.doubts.contains(Doubts::NOT_READ) {
            return Some(ParameterTrouble::NotRead);
        }
        if !self.doubts.is_empty() && !self.doubts.contains(Doubts::ENDED) {
            // Or what another version has marked.
            let is_damaged = self.doubts != Doubts::HALF_LOADED;
            return Some(if is_damaged {
                ParameterTrouble::Damaged
            } else {
                ParameterTrouble::HalfLoaded
            });
        }
        if self.misfits.is_empty() {
            return None;
        }
        let first = ParameterId::all().find(|id| self.misfits.contains(*id) && self.listed.contains(*id));
        first.map(ParameterTrouble::DoesNotFit)
    }

    /// Takes over the mark, which is stored as bits.
    pub(super) fn restore_mark(&mut self, value: f32) {
        self.doubts |= Doubts::from_bits_retain(value.to_bits() as u8).marked();
    }

    /// The stored form of a parameter: its value, or the mark.
    pub(super) fn to_store(&self, id: ParameterId) -> f32 {
        if id == CHECKED {
            f32::from_bits(self.doubts.marked().bits().into())
        } else {
            self.get(id)
        }
    }

    fn end(&mut self, ended: Doubts) {
        let left = self.doubts - ended;
        if left.marked().is_empty() {
            self.doubts |= Doubts::ENDED;
            self.take_mark_back();
        } else {
            self.set_doubts(left);
        }
    }

    /// Takes the mark back if that is due, and everything else is saved.
    pub(super) fn take_mark_back(&mut self) {
        if self.doubts.contains(Doubts::ENDED) && self.unsaved_count() == 0 {
            self.doubts -= Doubts::ENDED;
            self.set_doubts(self.doubts & Doubts::NOT_READ);
        }
    }

    #[inline(never)]
    fn set_doubts(&mut self, doubts: Doubts) {
        if doubts != self.doubts {
            self.doubts = doubts;
            self.mark_unsaved(CHECKED);
        }
    }
}
