//! Unsaved changes and failed attempts to save them.

use core::fmt;

use super::trouble::{CHECKED, Doubts};
use super::{Access, ParameterId, ParameterIdSet, Parameters, VehicleParameter};
use crate::announce::{Announce, Severity};
use crate::memory::storage::StorageError;

/// Here alone a link may accept less without the key than by default: on others the default is nothing.
const KEPT: ParameterId = ParameterId::Vehicle(VehicleParameter::SignUsbAllow);

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
    /// loaded or did not fit. No link accepts more without the key than before.
    pub fn reset(&mut self) {
        let kept = self.get(KEPT);
        let keeps_unsaved = self.unsaved.contains(KEPT) || self.misfits.contains(KEPT);
        for changes in [&mut self.unsaved, &mut self.waiting, &mut self.misfits] {
            *changes = ParameterIdSet::default();
        }
        if keeps_unsaved {
            self.unsaved.insert(KEPT);
        }
        for id in ParameterId::all().filter(|id| matches!(id.row().access, Access::Setting(_))) {
            self.write(id, self.default_of(id));
        }
        if kept < self.get(KEPT) {
            self.write(KEPT, kept);
        }
        self.doubts &= Doubts::NOT_READ;
        self.half_file = None;
        (self.reset, self.reset_waits, self.is_reported) = (true, false, false);
    }

    /// The value has to be written, whatever has failed before.
    pub(super) fn mark_unsaved(&mut self, id: ParameterId) {
        self.mark_as_stored(id);
        self.unsaved.insert(id);
        self.is_reported = false;
    }

    /// Flash holds the live value.
    pub(super) fn mark_as_stored(&mut self, id: ParameterId) {
        for changes in [&mut self.unsaved, &mut self.waiting, &mut self.misfits] {
            changes.remove(id);
        }
    }

    fn is_due(&self, id: ParameterId) -> bool {
        self.unsaved.contains(id) && !self.waiting.contains(id)
    }

    /// The next change to write; `None` if all are saved or wait for a retry.
    pub fn next_unsaved(&self) -> Option<Unsaved> {
        // The mark of a trouble comes before all others. Two sets are compared in a tenth of the time that all ids take.
        let changed = if self.unsaved.contains(CHECKED) {
            Some(CHECKED).filter(|id| self.is_due(*id))
        } else if self.unsaved == self.waiting {
            None
        } else {
            ParameterId::all().find(|id| self.is_due(*id))
        };
        if self.reset && self.is_due(KEPT) {
            return Some(Unsaved::Value(KEPT, self.to_store(KEPT)));
        }
        if self.reset {
            // Values stored before the reset would be erased with it.
            return (!self.reset_waits || changed.is_some()).then_some(Unsaved::Reset);
        }
        changed.map(|id| Unsaved::Value(id, self.to_store(id)))
    }

    /// A change was written. A value that has changed since still has to be saved.
    pub fn mark_saved(&mut self, saved: Unsaved) {
        match saved {
            Unsaved::Reset => (self.reset, self.reset_waits) = (false, false),
            Unsaved::Value(id, value) => {
                if value.to_bits() == self.to_store(id).to_bits() {
                    self.mark_as_stored(id);
                }
            }
        }
        if self.waiting.is_empty() {
            self.failure = None;
        }
        self.take_mark_back();
    }

    /// Writing a change failed: it waits for a retry, and so do all other changes unless flash is only full.
    ///
    /// Returns the error if it has to be reported: the first one since a change, or not like the one before.
    pub fn mark_failed(&mut self, unsaved: Unsaved, error: StorageError) -> Option<StorageError> {
        match unsaved {
            Unsaved::Value(id, _) if error == StorageError::Full => {
                if !self.is_due(id) {
                    return None;
                }
                self.waiting.insert(id);
            }
            Unsaved::Reset | Unsaved::Value(..) => {
                self.waiting = self.unsaved.clone();
                self.reset_waits = self.reset;
            }
        }
        let before = self.failure.replace(error).filter(|_| self.is_reported);
        self.is_reported = true;
        let is_known = before.is_some_and(|before| before.is_like(error));
        (!is_known).then_some(error)
    }

    /// Retries all failed changes.
    pub fn retry_failed(&mut self) {
        self.waiting = ParameterIdSet::default();
        self.reset_waits = false;
    }

    /// Why changes could not be saved, if that is so.
    pub fn save_failure(&self) -> Option<SaveFailure> {
        self.unsaved_by(self.failure?)
    }

    /// The changes that are not saved, if there are any, as a failure with this error.
    pub fn unsaved_by(&self, error: StorageError) -> Option<SaveFailure> {
        let changes = self.unsaved_count();
        (changes > 0).then_some(SaveFailure { error, changes })
    }

    /// Number of changes that are not saved.
    #[inline(never)]
    pub(super) fn unsaved_count(&self) -> usize {
        self.unsaved.len() + usize::from(self.reset)
    }
}

#[cfg(test)]
mod tests;
