//! When what could not be saved is tried again, and how often that is reported.

use crate::storage::StorageError;

/// Before what could not be written is tried again without being asked: a worn sector won't recover, and each attempt
/// stops everything for the time of an erase.
pub const SAVE_RETRY_INTERVAL_US: u64 = 60_000_000;

/// Between two reports: a file of parameters that is sent to a worn flash fails at each of them.
const REPORT_INTERVAL_US: u64 = 5_000_000;

/// Failures to save: when to retry, when to report.
#[derive(Debug, Default)]
pub struct SaveFailures {
    retry_at_us: Option<u64>,
    /// The latest failure that has not been reported yet.
    to_report: Option<StorageError>,
    silent_until_us: u64,
}

impl SaveFailures {
    /// Something could not be saved; `news` is what has to be reported of it.
    pub fn add(&mut self, news: Option<StorageError>, now_us: u64) {
        self.to_report = news.or(self.to_report);
        // What fails later does not put off the retry of what failed first.
        self.retry_at_us
            .get_or_insert(now_us.saturating_add(SAVE_RETRY_INTERVAL_US));
    }

    /// Whether what failed has to be tried again at `now_us`; true once.
    pub fn take_retry(&mut self, now_us: u64) -> bool {
        self.retry_at_us.take_if(|at_us| *at_us <= now_us).is_some()
    }

    /// The failure that has to be reported at `now_us`, once.
    pub fn take_report(&mut self, now_us: u64) -> Option<StorageError> {
        if now_us < self.silent_until_us {
            return None;
        }
        let report = self.to_report.take()?;
        self.silent_until_us = now_us.saturating_add(REPORT_INTERVAL_US);
        Some(report)
    }
}

/// What is reported of values that are live and can't be saved.
pub fn save_failure_text(error: StorageError) -> &'static str {
    match error {
        StorageError::Full => "Parameters can't be saved: too many changed",
        StorageError::Flash | StorageError::Corrupt => "Parameters can't be saved: flash worn out?",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_US: u64 = 1_000_000;
    const FLASH: Option<StorageError> = Some(StorageError::Flash);
    const FULL: Option<StorageError> = Some(StorageError::Full);

    #[test]
    fn a_retry_is_due_once_a_minute_after_the_first_failure() {
        let mut failures = SaveFailures::default();
        assert!(!failures.take_retry(u64::MAX));
        failures.add(None, 10 * SECOND_US);
        failures.add(FLASH, 60 * SECOND_US);
        assert!(!failures.take_retry(70 * SECOND_US - 1));
        assert!(failures.take_retry(70 * SECOND_US));
        assert!(!failures.take_retry(u64::MAX));
        failures.add(None, 70 * SECOND_US);
        assert!(!failures.take_retry(130 * SECOND_US - 1));
        assert!(failures.take_retry(130 * SECOND_US));
    }

    #[test]
    fn only_news_is_reported_and_once() {
        let mut failures = SaveFailures::default();
        failures.add(None, 0);
        assert_eq!(failures.take_report(0), None);
        failures.add(FLASH, 0);
        assert_eq!(failures.take_report(0), FLASH);
        assert_eq!(failures.take_report(u64::MAX), None);
    }

    #[test]
    fn reports_in_a_row_are_five_seconds_apart_and_the_latest_is_not_lost() {
        let mut failures = SaveFailures::default();
        failures.add(FLASH, 0);
        assert_eq!(failures.take_report(0), FLASH);
        failures.add(FLASH, SECOND_US);
        failures.add(FULL, 2 * SECOND_US);
        failures.add(None, 3 * SECOND_US);
        assert_eq!(failures.take_report(5 * SECOND_US - 1), None);
        assert_eq!(failures.take_report(5 * SECOND_US), FULL);
        failures.add(FLASH, 10 * SECOND_US);
        assert_eq!(failures.take_report(10 * SECOND_US), FLASH);
    }
}
