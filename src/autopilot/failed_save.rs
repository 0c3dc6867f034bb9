//! A failure to write to flash, and when to try again.

use crate::parameter::SAVE_RETRY_INTERVAL_US;
use crate::storage::StorageError;
use crate::time::Instant;

/// Failures to write one kind of data: what is learnt of the packs, or names and passwords of networks.
#[derive(Debug, Default)]
pub(super) struct FailedSave {
    /// The latest one, until a write succeeds.
    pub failure: Option<StorageError>,
    /// When to try again.
    pub retry_at: Option<Instant>,
}

impl FailedSave {
    /// Counts a failure, to be repeated after a minute, and returns it if it has to be announced: unless the last one was
    /// like it.
    pub fn add(&mut self, error: StorageError, now: Instant) -> Option<StorageError> {
        self.retry_at = Some(now.after_us(SAVE_RETRY_INTERVAL_US));
        let before = self.failure.replace(error);
        let is_known = before.is_some_and(|before| before.is_like(error));
        (!is_known).then_some(error)
    }
}
