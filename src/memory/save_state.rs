//! Progress of saving one kind of data.

use super::storage::StorageError;
use crate::time::Instant;

/// Interval between automatic retries: a worn sector won't recover, and each attempt blocks for the time of an erase.
const RETRY_INTERVAL_US: u64 = 60_000_000;

/// Progress of saving one kind of data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SaveState {
    /// Nothing has failed.
    #[default]
    Saved,
    /// To be written.
    New,
    /// Writing failed: waits for a retry at this time.
    Failed(StorageError, Instant),
    /// Failed before; to be written again.
    Retried(StorageError),
}

impl SaveState {
    /// Whether it waits for a retry.
    pub fn is_waiting(&self) -> bool {
        matches!(self, Self::Failed(..))
    }

    /// The latest failure, until a write succeeds.
    pub fn failure(&self) -> Option<StorageError> {
        match self {
            Self::Failed(error, _) | Self::Retried(error) => Some(*error),
            Self::Saved | Self::New => None,
        }
    }

    /// Tries again after a failure.
    pub fn retry(&mut self) {
        if let Self::Failed(error, _) = self {
            *self = Self::Retried(*error);
        }
    }

    /// Writing failed at `now`, to be tried again after a minute; a later failure does not postpone that. Returns the error
    /// if it has to be announced: unless the last one was like it.
    pub fn fail(&mut self, error: StorageError, now: Instant) -> Option<StorageError> {
        let when = match self {
            Self::Failed(_, when) => *when,
            _ => now.after_us(RETRY_INTERVAL_US),
        };
        let is_known = self.failure().is_some_and(|before| before.is_like(error));
        *self = Self::Failed(error, when);
        (!is_known).then_some(error)
    }

    /// Tries again what has failed if that is due at `now`, and returns whether it is; true once.
    pub fn take_retry(&mut self, now: Instant) -> bool {
        let is_due = matches!(self, Self::Failed(_, when) if *when <= now);
        if is_due {
            self.retry();
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::storage::FlashFault;
    use crate::time::at_us;

    const SECOND_US: u64 = 1_000_000;
    const FLASH: StorageError = StorageError::Flash(FlashFault::NotVerified);

    #[test]
    // Requirement: L-18
    fn retry_is_due_once_one_minute_after_the_first_failure() {
        let mut state = SaveState::default();
        assert!(!state.take_retry(Instant::MAX));
        state.fail(FLASH, at_us(10 * SECOND_US));
        state.fail(FLASH, at_us(60 * SECOND_US));
        assert!(!state.take_retry(at_us(70 * SECOND_US - 1)) && state.is_waiting());
        assert!(state.take_retry(at_us(70 * SECOND_US)) && !state.is_waiting());
        assert!(!state.take_retry(Instant::MAX));
        state.fail(FLASH, at_us(70 * SECOND_US));
        assert!(!state.take_retry(at_us(130 * SECOND_US - 1)));
        assert!(state.take_retry(at_us(130 * SECOND_US)));
    }

    #[test]
    fn a_failure_is_announced_unless_the_last_one_was_like_it() {
        let other_fault = StorageError::Flash(FlashFault::Other);
        let mut state = SaveState::default();
        for (error, is_announced) in [
            (FLASH, true),
            (other_fault, false),
            (StorageError::NoErasedSpace, true),
            (FLASH, true),
        ] {
            let expected = is_announced.then_some(error);
            assert_eq!(state.fail(error, Instant::EPOCH), expected);
            assert_eq!(state.failure(), Some(error));
            state.retry();
        }
        assert_eq!(state.failure(), Some(FLASH), "until a write succeeds");
    }
}
