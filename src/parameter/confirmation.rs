//! Doubts of the live values, and their end.
//!
//! Damaged or half loaded parameters leave a mark in flash, under the key of `PARAM_CHECKED`: stored before any other value, and taken
//! back after all of them. What does not fit needs none: the value stays stored under its key until the parameter is set.

use super::trouble::{CHECKED, Doubts, HalfFile};
use super::{ParameterId, ParameterIdSet, ParameterTrouble, Parameters};

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

    /// A file that announced this many parameters has set one that bears on the drive: if that has changed it, the file counts as half
    /// loaded until [`end_file`](Self::end_file).
    pub fn set_by_file(&mut self, id: ParameterId, announced: u16) {
        if !self.unsaved.contains(id) {
            return;
        }
        if !self.is_half_loaded() {
            self.half_file = Some(HalfFile::default());
        }
        self.set_doubts((self.doubts - Doubts::ENDED) | Doubts::HALF_LOADED);
        if let Some(half) = &mut self.half_file {
            half.changed.insert(id);
            half.announced = half.announced.max(announced);
        }
    }

    /// Counts what a file lacks that has `records` parameters by now, and has set these.
    pub fn follow_file(&mut self, records: u16, set: &ParameterIdSet) {
        if let Some(half) = &mut self.half_file {
            let unset = half.changed.count_without(set) as u16;
            half.missing = half.announced.saturating_sub(records).max(unset);
        }
    }

    /// A file has come whole, with `records` parameters of which it has set these. It ends those that did not come whole if it has as many
    /// as they announced, and all that they have changed. That is unknown after a restart.
    pub fn end_file(&mut self, records: u16, set: &ParameterIdSet) {
        self.follow_file(records, set);
        if self.half_file.take_if(|half| half.missing == 0).is_some() {
            self.end(Doubts::HALF_LOADED);
        }
    }

    /// The owner has checked the values that the present [`trouble`](Self::trouble) is about: what is live is to be stored. Without effect
    /// while those in flash are not known.
    pub fn confirm(&mut self) {
        match self.trouble() {
            None | Some(ParameterTrouble::NotRead) => {}
            Some(ParameterTrouble::Damaged | ParameterTrouble::HalfLoaded { .. }) => {
                self.half_file = None;
                self.end(self.doubts);
            }
            // The others were not named yet.
            Some(ParameterTrouble::DoesNotFit(first, second)) => {
                self.mark_unsaved(first);
                if let Some(second) = second {
                    self.mark_unsaved(second);
                }
            }
        }
    }

    fn is_half_loaded(&self) -> bool {
        self.doubts.contains(Doubts::HALF_LOADED) && !self.doubts.contains(Doubts::ENDED)
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
                let missing = self.half_file.as_ref().map(|half| half.missing);
                ParameterTrouble::HalfLoaded {
                    missing: missing.filter(|missing| *missing > 0),
                }
            });
        }
        if self.misfits.is_empty() {
            return None;
        }
        let is_misfit = |id: &ParameterId| self.misfits.contains(*id) && self.listed.contains(*id);
        let mut misfits = ParameterId::all().filter(is_misfit);
        Some(ParameterTrouble::DoesNotFit(misfits.next()?, misfits.next()))
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
