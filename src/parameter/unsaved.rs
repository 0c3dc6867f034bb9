//! What of the live values is not in flash yet, and what has become of the attempts to write it.

use super::{Flash, ParameterId, Parameters};
use crate::storage::StorageError;

/// How far a change has come on its way to flash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Progress {
    /// Nothing has to be written.
    #[default]
    Saved,
    /// It has to be written.
    New,
    /// It could not be written, and waits for [`Parameters::retry_failed`].
    Failed(StorageError),
    /// It could not be written, and has to be written now.
    Retried(StorageError),
}

/// Something that has to be done to the flash for it to hold the live values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsaved {
    /// Everything stored has to be cleared: the parameters were reset.
    Reset,
    /// This value of a parameter has to be stored.
    Value(ParameterId, f32),
}

impl Progress {
    fn is_due(self) -> bool {
        matches!(self, Self::New | Self::Retried(_))
    }

    fn failure(self) -> Option<StorageError> {
        match self {
            Self::Failed(error) | Self::Retried(error) => Some(error),
            Self::Saved | Self::New => None,
        }
    }

    fn retried(self) -> Self {
        match self {
            Self::Failed(error) => Self::Retried(error),
            other => other,
        }
    }
}

impl Parameters {
    /// Sets every live value to its default, once and for all; what is stored still has to be cleared.
    pub fn reset(&mut self) {
        self.values.set_all(ParameterId::default_value);
        self.progress.update_all(|_| Progress::Saved);
        self.reset = Progress::New;
        self.flash = Flash::AsLive;
    }

    /// What has to be written now; `None` if everything is saved or waits for a retry.
    pub fn next_unsaved(&self) -> Option<Unsaved> {
        let changed = ParameterId::all().find(|id| self.progress.get(*id).is_due());
        if self.reset != Progress::Saved {
            // What was stored before would be cleared with the rest.
            return (self.reset.is_due() || changed.is_some()).then_some(Unsaved::Reset);
        }
        changed.map(|id| Unsaved::Value(id, self.get(id)))
    }

    /// It is in flash now. A value that was replaced meanwhile still has to be saved.
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

    /// It could not be written, so it waits for a retry; and with it everything else that has to be written, unless the
    /// flash is sound and just has no room for this one.
    ///
    /// Returns the failure if it is news: of a change that has not failed before, or not for this reason.
    pub fn mark_failed(&mut self, unsaved: Unsaved, error: StorageError) -> Option<StorageError> {
        let mut is_news = false;
        let mut fail = |progress: Progress| {
            if !progress.is_due() {
                return progress;
            }
            is_news |= progress.failure() != Some(error);
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
        is_news.then_some(error)
    }

    /// Has everything written once more that could not be written.
    pub fn retry_failed(&mut self) {
        self.reset = self.reset.retried();
        self.progress.update_all(Progress::retried);
    }

    /// Why a change is not in flash, if one could not be written.
    pub fn save_failure(&self) -> Option<StorageError> {
        let of_values = || ParameterId::all().find_map(|id| self.progress.get(id).failure());
        self.reset.failure().or_else(of_values)
    }
}

#[cfg(test)]
mod tests;
