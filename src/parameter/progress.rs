//! How far the saving of a change is.

use crate::memory::storage::StorageError;

/// Progress of saving a change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Progress {
    /// Nothing to write.
    #[default]
    Saved,
    /// To be written.
    New,
    /// Failed; waits for [`Parameters::retry_failed`](super::Parameters::retry_failed).
    Failed(StorageError),
    /// Failed before; to be written again.
    Retried(StorageError),
}

impl Progress {
    pub fn is_due(self) -> bool {
        matches!(self, Self::New | Self::Retried(_))
    }

    pub fn failure(self) -> Option<StorageError> {
        match self {
            Self::Failed(error) | Self::Retried(error) => Some(error),
            Self::Saved | Self::New => None,
        }
    }

    pub fn retried(self) -> Self {
        match self {
            Self::Failed(error) => Self::Retried(error),
            other => other,
        }
    }
}
