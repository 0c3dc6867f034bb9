//! Unsaved changes and failed attempts to save them.

use core::iter;

use super::parameters::{Flash, Parameters};
use super::progress::Progress;
use super::{Access, ParameterId, SaveFailure};
use crate::memory::storage::StorageError;

/// A change that has to be written to flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsaved {
    /// Erase all stored values: the parameters were reset.
    Reset,
    /// Store this value of a parameter.
    Value(ParameterId, f32),
}

impl Parameters {
    /// Resets all settings to their defaults, and marks the stored ones to be erased.
    pub fn reset(&mut self) {
        for id in ParameterId::all().filter(|id| id.row().access == Access::Setting) {
            self.values.set(id, id.default_value());
        }
        self.progress.update_all(|_| Progress::Saved);
        self.reset = Progress::New;
        self.flash = Flash::Loaded;
    }

    /// The next change to write; `None` if all are saved or wait for a retry.
    pub fn next_unsaved(&self) -> Option<Unsaved> {
        if !self.all_progress().any(Progress::is_due) {
            return None;
        }
        let changed = ParameterId::all().find(|id| self.progress.get(*id).is_due());
        if self.reset != Progress::Saved {
            // Values stored before the reset would be erased with it.
            return (self.reset.is_due() || changed.is_some()).then_some(Unsaved::Reset);
        }
        changed.map(|id| Unsaved::Value(id, self.get(id)))
    }

    /// A change was written. A value that has changed since still has to be saved.
    pub fn mark_saved(&mut self, saved: Unsaved) {
        match saved {
            Unsaved::Reset => self.reset = Progress::Saved,
            Unsaved::Value(id, value) => {
                if value.to_bits() == self.get(id).to_bits() {
                    self.progress.set(id, Progress::Saved);
                }
            }
        }
    }

    /// Writing a change failed: it waits for a retry, and so do all other changes unless flash is only full.
    ///
    /// Returns the error if it has to be reported: a change failed for the first time, or not like before.
    pub fn mark_failed(&mut self, unsaved: Unsaved, error: StorageError) -> Option<StorageError> {
        let mut is_new = false;
        let mut fail = |progress: Progress| {
            if !progress.is_due() {
                return progress;
            }
            is_new |= !progress.failure().is_some_and(|before| before.is_like(error));
            Progress::Failed(error)
        };
        match unsaved {
            Unsaved::Value(id, _) if error == StorageError::Full => {
                self.progress.set(id, fail(self.progress.get(id)));
            }
            Unsaved::Reset | Unsaved::Value(..) => {
                self.reset = fail(self.reset);
                self.progress.update_all(fail);
            }
        }
        is_new.then_some(error)
    }

    /// Retries all failed changes.
    pub fn retry_failed(&mut self) {
        self.reset = self.reset.retried();
        self.progress.update_all(Progress::retried);
    }

    /// Why changes could not be saved, if that is so.
    pub fn save_failure(&self) -> Option<SaveFailure> {
        let error = self.all_progress().find_map(Progress::failure)?;
        self.unsaved_by(error)
    }

    /// The changes that are not saved, if there are any, as a failure with this error.
    pub fn unsaved_by(&self, error: StorageError) -> Option<SaveFailure> {
        let changes = self
            .all_progress()
            .filter(|progress| *progress != Progress::Saved)
            .count();
        (changes > 0).then_some(SaveFailure { error, changes })
    }

    /// How far the reset and all values are.
    fn all_progress(&self) -> impl Iterator<Item = Progress> {
        iter::once(self.reset).chain(self.progress.values())
    }
}

#[cfg(test)]
mod tests;
