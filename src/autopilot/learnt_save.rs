//! Failures to write what is learnt of the packs.

use crate::storage::StorageError;
use crate::time::Instant;

/// Failures to write what is learnt of the packs.
#[derive(Debug, Default)]
pub(super) struct LearntSave {
    /// The latest one, until a write succeeds.
    pub failure: Option<StorageError>,
    /// When to try again.
    pub retry_at: Option<Instant>,
}
