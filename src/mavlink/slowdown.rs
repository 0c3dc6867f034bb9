//! Slowdown of streams for a radio that can't keep up.

use crate::time::Instant;

const MICROSECONDS_PER_MILLISECOND: u64 = 1000;

/// The longest delay: as in ArduPilot, a stream still leaves every two seconds.
const LONGEST_MS: u16 = 2000;

/// Several reports of a radio. ArduPilot takes one for stale after the same time.
const REPORT_STALE_US: u64 = 5_000_000;

/// The delay that is added to every stream's interval while a radio reports (RADIO_STATUS) that its transmit buffer is
/// full. The steps are ArduPilot's, so that radios tuned for it behave the same.
///
/// Radios can't sign, so a report may be forged. That is why the delay is bounded, and ends when the reports do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slowdown {
    delay_ms: u16,
    reported_at: Instant,
}

impl Slowdown {
    /// Addition to an interval, in µs.
    pub fn delay_us(self) -> u64 {
        u64::from(self.delay_ms) * MICROSECONDS_PER_MILLISECOND
    }

    /// `percent` of the radio's transmit buffer is free.
    pub fn report(&mut self, percent: u8, now: Instant) {
        let delay_ms = self.delay_ms;
        self.delay_ms = match percent {
            0..20 => delay_ms.saturating_add(60).min(LONGEST_MS),
            20..50 => delay_ms.saturating_add(20).min(LONGEST_MS),
            96.. if delay_ms > 200 => delay_ms.saturating_sub(40),
            91.. => delay_ms.saturating_sub(20),
            _ => delay_ms,
        };
        self.reported_at = now;
    }

    /// Whether streams are slowed down by a report that is stale.
    pub fn is_stale(self, now: Instant) -> bool {
        self.delay_ms > 0 && now.us_since(self.reported_at) >= REPORT_STALE_US
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    fn it_grows_while_the_buffer_is_full_and_shrinks_while_it_is_empty() {
        let mut slowdown = Slowdown::default();
        for _ in 0..1000 {
            slowdown.report(0, Instant::EPOCH);
        }
        assert_eq!(slowdown.delay_us(), 2_000_000);
        slowdown.report(70, Instant::EPOCH);
        assert_eq!(slowdown.delay_us(), 2_000_000, "neither full nor empty");
        for _ in 0..60 {
            slowdown.report(100, Instant::EPOCH);
        }
        assert_eq!(slowdown.delay_us(), 0);
    }

    #[test]
    fn any_report_keeps_it_for_five_seconds() {
        let mut slowdown = Slowdown::default();
        slowdown.report(0, Instant::EPOCH);
        slowdown.report(70, at_us(3_000_000));
        assert!(!slowdown.is_stale(at_us(7_999_999)));
        assert!(slowdown.is_stale(at_us(8_000_000)));
        assert!(!Slowdown::default().is_stale(at_us(8_000_000)), "nothing to end");
    }
}
