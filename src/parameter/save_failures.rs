//! Retries and reports of failures to save parameters.

use core::{fmt, mem};

use crate::memory::storage::StorageError;
use crate::time::Instant;

/// Interval between automatic retries: a worn sector won't recover, and each attempt blocks for the time of an erase.
pub const SAVE_RETRY_INTERVAL_US: u64 = 60_000_000;

/// Minimum interval between reports: loading a parameter file into a worn flash fails at every parameter.
const REPORT_INTERVAL_US: u64 = 5_000_000;

/// When the first of several changes has to wait for erased space, the others get this long to be reported with it.
const COLLECTION_US: u64 = 1_000_000;

/// Changes that could not be saved: they are live.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SaveFailure {
    /// Why.
    pub error: StorageError,
    /// How many are not saved; a reset is one.
    pub changes: usize,
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

/// Failures to save parameters: pending retry and report.
#[derive(Debug, Default)]
pub struct SaveFailures {
    retry_at: Option<Instant>,
    /// The latest unreported error.
    to_report: Option<StorageError>,
    muted_until: Instant,
    /// Whether one was announced since everything was saved.
    announced: Announced,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Announced {
    #[default]
    Nothing,
    Failure,
}

impl SaveFailures {
    /// Adds a failure; `report` is the error if it has to be reported.
    pub fn add(&mut self, report: Option<StorageError>, now: Instant) {
        if report == Some(StorageError::NoErasedSpace) && self.to_report.is_none() {
            self.muted_until = self.muted_until.max(now.after_us(COLLECTION_US));
        }
        self.to_report = report.or(self.to_report);
        // A later failure does not postpone the retry.
        self.retry_at.get_or_insert(now.after_us(SAVE_RETRY_INTERVAL_US));
    }

    /// Whether a retry is due at `now`; true once.
    pub fn take_retry(&mut self, now: Instant) -> bool {
        self.retry_at.take_if(|at| *at <= now).is_some()
    }

    /// The error to report at `now`, once.
    pub fn take_report(&mut self, now: Instant) -> Option<StorageError> {
        if now < self.muted_until {
            return None;
        }
        let report = self.to_report.take()?;
        self.muted_until = now.after_us(REPORT_INTERVAL_US);
        Some(report)
    }

    /// What [`take_report`](Self::take_report) has returned was announced: it may have been over by then.
    pub fn mark_announced(&mut self) {
        self.announced = Announced::Failure;
    }

    /// Whether a failure was announced; once, after everything was saved.
    pub fn take_recovery(&mut self) -> bool {
        mem::take(&mut self.announced) == Announced::Failure
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::storage::FlashFault;
    use crate::time::at_us;

    const SECOND_US: u64 = 1_000_000;
    const FLASH: Option<StorageError> = Some(StorageError::Flash(FlashFault::NotVerified));
    const FULL: Option<StorageError> = Some(StorageError::Full);
    const UNERASED: Option<StorageError> = Some(StorageError::NoErasedSpace);

    #[test]
    fn retry_is_due_once_one_minute_after_the_first_failure() {
        let mut failures = SaveFailures::default();
        assert!(!failures.take_retry(Instant::MAX));
        failures.add(None, at_us(10 * SECOND_US));
        failures.add(FLASH, at_us(60 * SECOND_US));
        assert!(!failures.take_retry(at_us(70 * SECOND_US - 1)));
        assert!(failures.take_retry(at_us(70 * SECOND_US)));
        assert!(!failures.take_retry(Instant::MAX));
        failures.add(None, at_us(70 * SECOND_US));
        assert!(!failures.take_retry(at_us(130 * SECOND_US - 1)));
        assert!(failures.take_retry(at_us(130 * SECOND_US)));
    }

    #[test]
    fn error_is_reported_once() {
        let mut failures = SaveFailures::default();
        failures.add(None, Instant::EPOCH);
        assert_eq!(failures.take_report(Instant::EPOCH), None);
        failures.add(FLASH, Instant::EPOCH);
        assert_eq!(failures.take_report(Instant::EPOCH), FLASH);
        assert_eq!(failures.take_report(Instant::MAX), None);
    }

    #[test]
    fn reports_are_five_seconds_apart_and_the_latest_is_kept() {
        let mut failures = SaveFailures::default();
        failures.add(FLASH, Instant::EPOCH);
        assert_eq!(failures.take_report(Instant::EPOCH), FLASH);
        failures.add(FLASH, at_us(SECOND_US));
        failures.add(FULL, at_us(2 * SECOND_US));
        failures.add(None, at_us(3 * SECOND_US));
        assert_eq!(failures.take_report(at_us(5 * SECOND_US - 1)), None);
        assert_eq!(failures.take_report(at_us(5 * SECOND_US)), FULL);
        failures.add(FLASH, at_us(10 * SECOND_US));
        assert_eq!(failures.take_report(at_us(10 * SECOND_US)), FLASH);
    }

    #[test]
    fn changes_that_wait_for_erased_space_are_reported_together() {
        let mut failures = SaveFailures::default();
        for ms in 0..20 {
            failures.add(UNERASED, at_us(ms * 100_000));
            let expected = if ms == 10 { UNERASED } else { None };
            assert_eq!(failures.take_report(at_us(ms * 100_000)), expected, "{ms}");
        }
        assert_eq!(failures.take_report(at_us(6 * SECOND_US - 1)), None);
        assert_eq!(failures.take_report(at_us(6 * SECOND_US)), UNERASED);
    }

    #[test]
    fn recovery_is_reported_once_and_only_after_an_announcement() {
        let mut failures = SaveFailures::default();
        failures.add(UNERASED, Instant::EPOCH);
        assert_eq!(failures.take_report(at_us(SECOND_US)), UNERASED);
        assert!(!failures.take_recovery(), "not announced");
        failures.mark_announced();
        assert!(failures.take_recovery());
        assert!(!failures.take_recovery());
    }

    #[test]
    fn texts_fit_one_message() {
        for (error, text) in [
            (StorageError::Full, "Parameters can't be saved: too many changed"),
            (
                StorageError::Corrupt,
                "Parameters can't be saved: flash worn out?",
            ),
            (
                StorageError::NoErasedSpace,
                "Parameters: 388 not saved until disarmed",
            ),
        ] {
            assert_eq!(SaveFailure { error, changes: 388 }.to_string(), text);
            assert!(text.len() <= 50);
        }
    }
}
