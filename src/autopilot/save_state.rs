//! Progress of writing to flash: failures and when to try again; the signing key.

use crate::mavlink::SigningChange;
use crate::memory::storage::StorageError;
use crate::parameter::SAVE_RETRY_INTERVAL_US;
use crate::time::Instant;
use crate::vehicle::ArmState;

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

/// Progress of writing the signing key.
#[derive(Debug, Default)]
pub(super) struct SigningSave {
    /// To announce once it is in flash.
    pub change: Option<SigningChange>,
    /// Whether the last write has failed: it is repeated once, in the next sector.
    pub is_repeated: bool,
    /// After a failure, when to start again without a request.
    pub retry_at: Instant,
    /// Since when the vehicle has been armed, as far as it was looked at.
    armed_since: Option<Instant>,
}

impl SigningSave {
    /// For how long the vehicle has been armed; 0 if it is not.
    pub fn armed_us(&mut self, arm_state: ArmState, now: Instant) -> u64 {
        match arm_state {
            ArmState::Armed => now.us_since(*self.armed_since.get_or_insert(now)),
            ArmState::Disarmed => {
                self.armed_since = None;
                0
            }
        }
    }
}
