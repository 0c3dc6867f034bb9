//! Unsaved changes and failed attempts to save them.

use core::{fmt, iter};

use super::trouble::{CHECKED, Doubts};
use super::{Access, ParameterId, Parameters};
use crate::announce::{Announce, Severity};
use crate::memory::save_state::SaveState;
use crate::memory::storage::StorageError;

/// A change that has to be written to flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsaved {
    /// Erase all stored values: the parameters were reset.
    Reset,
    /// Store this value of a parameter.
    Value(ParameterId, f32),
}

/// Changes that could not be saved: they are live.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SaveFailure {
    /// Why.
    pub error: StorageError,
    /// Their number; a reset is one.
    pub changes: usize,
}

impl Announce for SaveFailure {
    fn severity(&self) -> Severity {
        match self.error {
            StorageError::NoErasedSpace => Severity::Warning,
            _ => Severity::Critical,
        }
    }
}

impl fmt::Display for SaveFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.error {
            StorageError::NoErasedSpace => write!(f, "Parameters: {} not saved until disarmed", self.changes),
            StorageError::Full => f.write_str("Parameters can't be saved: too many changed"),
            StorageError::Flash(_) | StorageError::Corrupt => {
                f.write_str("Parameters can't be saved: flash worn out?")
            }
        }
    }
}

impl Parameters {
    /// Resets all settings to their defaults, and marks the stored ones to be erased: nothing is left of what was damaged, half
    /// loaded or did not fit.
    pub fn reset(&mut self) {
        for id in ParameterId::all().filter(|id| matches!(id.row().access, Access::Setting(_))) {
            self.write(id, id.default_value(), SaveState::Saved);
        }
        self.doubts &= Doubts::NOT_READ;
        self.save_states.set(CHECKED, SaveState::Saved);
        self.reset = SaveState::New;
    }

    /// The next change to write; `None` if all are saved or wait for a retry.
    pub fn next_unsaved(&self) -> Option<Unsaved> {
        if !self.all_states().any(|state| state.is_due()) {
            return None;
        }
        let is_due = |id: &ParameterId| self.save_states.get(*id).is_due();
        // The mark of a trouble comes before all others.
        let changed = match self.save_states.get(CHECKED) {
            SaveState::Saved => ParameterId::all().find(is_due),
            _ => Some(CHECKED).filter(is_due),
        };
        if self.reset != SaveState::Saved {
            // Values stored before the reset would be erased with it.
            return (self.reset.is_due() || changed.is_some()).then_some(Unsaved::Reset);
        }
        changed.map(|id| Unsaved::Value(id, self.to_store(id)))
    }

    /// A change was written. A value that has changed since still has to be saved.
    pub fn mark_saved(&mut self, saved: Unsaved) {
        match saved {
            Unsaved::Reset => self.reset = SaveState::Saved,
            Unsaved::Value(id, value) => {
                if value.to_bits() == self.to_store(id).to_bits() {
                    self.save_states.set(id, SaveState::Saved);
                }
            }
        }
        self.take_mark_back();
    }

    /// Writing a change failed: it waits for a retry, and so do all other changes unless flash is only full.
    ///
    /// Returns the error if it has to be reported: a change failed for the first time, or not like before.
    pub fn mark_failed(&mut self, unsaved: Unsaved, error: StorageError) -> Option<StorageError> {
        let mut report = None;
        let mut fail = |state: &mut SaveState| {
            if state.is_due() {
                report = state.fail_until((), error).or(report);
            }
        };
        match unsaved {
            Unsaved::Value(id, _) if error == StorageError::Full => {
                let mut state = self.save_states.get(id);
                fail(&mut state);
                self.save_states.set(id, state);
            }
            Unsaved::Reset | Unsaved::Value(..) => {
                fail(&mut self.reset);
                self.save_states.update_all(fail);
            }
        }
        report
    }

    /// Retries all failed changes.
    pub fn retry_failed(&mut self) {
        self.reset.retry();
        self.save_states.update_all(SaveState::retry);
    }

    /// Why changes could not be saved, if that is so.
    pub fn save_failure(&self) -> Option<SaveFailure> {
        let error = self.all_states().find_map(|state| state.failure())?;
        self.unsaved_by(error)
    }

    /// The changes that are not saved, if there are any, as a failure with this error.
    pub fn unsaved_by(&self, error: StorageError) -> Option<SaveFailure> {
        let changes = self.unsaved_count();
        (changes > 0).then_some(SaveFailure { error, changes })
    }

    /// Number of changes that are not saved.
    #[inline(never)]
    pub(super) fn unsaved_count(&self) -> usize {
        self.all_states().filter(SaveState::is_unsaved).count()
    }

    /// States of the reset and of all values.
    fn all_states(&self) -> impl Iterator<Item = SaveState> {
        iter::once(self.reset).chain(self.save_states.values())
    }
}

#[cfg(test)]
mod tests;
