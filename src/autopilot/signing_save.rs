//! Progress of writing the signing key to flash.

use crate::battery::ArmState;
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

/// A failed write is repeated once, in the next sector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Attempt {
    #[default]
    First,
    Second,
}
