//! How often the same thing is logged.

use core::cell::Cell;

use crate::time::Instant;

/// Allows one log line per `INTERVAL_US` about something that may happen many times a second.
#[derive(Debug)]
pub(crate) struct LogLimit<const INTERVAL_US: u64> {
    last: Cell<Option<Instant>>,
}

impl<const INTERVAL_US: u64> LogLimit<INTERVAL_US> {
    /// Nothing was logged yet.
    pub const fn new() -> Self {
        Self {
            last: Cell::new(None),
        }
    }

    /// Whether a line may be logged at `now`; then it counts as logged.
    pub fn allows(&self, now: Instant) -> bool {
        let is_due = self
            .last
            .get()
            .is_none_or(|last| now.us_since(last) >= INTERVAL_US);
        if is_due {
            self.last.set(Some(now));
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    fn one_line_is_logged_per_interval() {
        let limit = LogLimit::<1_000_000>::new();
        assert!(limit.allows(Instant::EPOCH));
        assert!(!limit.allows(at_us(999_999)));
        assert!(limit.allows(at_us(1_000_000)));
        assert!(!limit.allows(at_us(1_000_000)));
    }
}
