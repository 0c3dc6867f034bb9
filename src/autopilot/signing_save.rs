//! Progress of writing the signing key to flash.

use crate::mavlink::SigningChange;
use crate::time::Instant;

/// Progress of writing the signing key.
#[derive(Debug, Default)]
pub(super) struct SigningSave {
    /// To announce once it is in flash.
    pub change: Option<SigningChange>,
    pub attempt: Attempt,
    /// After a failure, when to start again without a request.
    pub retry_at: Instant,
}

/// A failed write is repeated once, in the next sector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Attempt {
    #[default]
    First,
    Second,
}
