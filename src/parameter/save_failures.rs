//! Retries and reports of failures to save parameters.

use crate::storage::StorageError;
use crate::time::Instant;

/// Interval between automatic retries: a worn sector won't recover, and each attempt blocks for the time of an erase.
pub const SAVE_RETRY_INTERVAL_US: u64 = 60_000_000;

/// Minimum interval between reports: loading a parameter file into a worn flash fails at every parameter.
const REPORT_INTERVAL_US: u64 = 5_000_000;

/// Failures to save parameters: pending retry and report.
#[derive(Debug, Default)]
pub struct SaveFailures {
    retry_at: Option<Instant>,
    /// The latest unreported error.
    to_report: Option<StorageError>,
    muted_until: Instant,
}

impl SaveFailures {
    /// Adds a failure; `report` is the error if it has to be reported.
    pub fn add(&mut self, report: Option<StorageError>, now: Instant) {
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
}

/// Text of an error: the values are live, but not saved.
pub fn save_failure_text(error: StorageError) -> &'static str {
    match error {
        StorageError::Full => "Parameters can't be saved: too many changed",
        StorageError::Flash(_) | StorageError::Corrupt => "Parameters can't be saved: flash worn out?",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::FlashFault;
    use crate::time::at_us;

    const SECOND_US: u64 = 1_000_000;
    const FLASH: Option<StorageError> = Some(StorageError::Flash(FlashFault::NotVerified));
    const FULL: Option<StorageError> = Some(StorageError::Full);

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
}
