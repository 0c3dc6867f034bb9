//! Moments, the time of day, and periodic due times without drift or catch-up bursts.

use core::fmt;
use core::num::{NonZeroU32, NonZeroU64};

pub use battery_gauge::Instant;

/// For tests that work with many moments.
#[cfg(test)]
pub(crate) const fn at_us(us: u64) -> Instant {
    Instant::from_micros(us)
}

/// A moment in UTC, in whole microseconds since 1970, without leap seconds, as computers count.
///
/// Its arithmetic saturates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct Utc {
    us: u64,
}

impl Utc {
    /// The moment `us` microseconds after 1970 began.
    pub const fn from_micros(us: u64) -> Self {
        Self { us }
    }

    /// The moment this many seconds after 1970 began.
    pub const fn from_seconds(seconds: u32) -> Self {
        Self::from_micros(seconds as u64 * 1_000_000)
    }

    /// Microseconds since 1970 began.
    pub const fn as_micros(self) -> u64 {
        self.us
    }

    /// Whole seconds since 1970 began; `None` within the first, and from 2106 on.
    pub fn seconds(self) -> Option<NonZeroU32> {
        u32::try_from(self.us / 1_000_000).ok().and_then(NonZeroU32::new)
    }

    /// The moment `us` microseconds later.
    pub const fn after_us(self, us: u64) -> Self {
        Self::from_micros(self.us.saturating_add(us))
    }

    /// The moment `us` microseconds earlier.
    pub const fn before_us(self, us: u64) -> Self {
        Self::from_micros(self.us.saturating_sub(us))
    }
}

/// A day of the calendar, which is displayed as ISO 8601 writes it: `2026-11-26`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Day {
    year: u32,
    month: u32,
    day: u32,
}

impl Day {
    /// That of UTC.
    pub fn of(utc: Utc) -> Self {
        const US_PER_DAY: u64 = 24 * 3_600 * 1_000_000;
        // In days.
        const FOUR_CENTURIES: u32 = 146_097;
        const FOUR_YEARS: u32 = 1_461;
        const FIVE_MONTHS: u32 = 153;
        const FROM_MARCH_1600_TO_1970: u32 = 135_080;
        // Years that begin with March have the day that may be missing at their end.
        let days = (utc.us / US_PER_DAY) as u32 + FROM_MARCH_1600_TO_1970;
        let century = (4 * days + 3) / FOUR_CENTURIES;
        let of_century = days - FOUR_CENTURIES * century / 4;
        let year = (4 * of_century + 3) / FOUR_YEARS;
        let of_year = of_century - FOUR_YEARS * year / 4;
        let month = (5 * of_year + 2) / FIVE_MONTHS;
        let day = of_year - (FIVE_MONTHS * month + 2) / 5 + 1;
        let march_year = 1_600 + 100 * century + year;
        let (year, month) = match month {
            ..10 => (march_year, month + 3),
            _ => (march_year + 1, month - 9),
        };
        Self { year, month, day }
    }
}

impl fmt::Display for Day {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{:02}-{:02}", self.year, self.month, self.day)
    }
}

/// Due times at a fixed interval.
///
/// Each due time is the previous one plus the interval, however late it was served, so the long-term rate is exact.
/// Missed intervals are skipped, and the phase is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cadence {
    interval_us: NonZeroU64,
    due: Instant,
}

impl Cadence {
    /// First due at `start`, then every `interval_us`, at least 1 µs.
    pub fn starting_at(start: Instant, interval_us: u64) -> Self {
        Self {
            interval_us: at_least_1_us(interval_us),
            due: start,
        }
    }

    /// Next due time.
    pub fn due(&self) -> Instant {
        self.due
    }

    /// Interval, in µs.
    pub fn interval_us(&self) -> u64 {
        self.interval_us.get()
    }

    /// Whether it is due at `now`; if so, advances to the next due time.
    // Inlined, its division would be repeated in every task.
    #[inline(never)]
    pub fn take(&mut self, now: Instant) -> bool {
        if now < self.due {
            return false;
        }
        self.due = self.due.after_us(self.interval_us());
        if self.due <= now {
            let missed = now.us_since(self.due) / self.interval_us + 1;
            self.due = self.due.after_us(missed.saturating_mul(self.interval_us()));
        }
        true
    }

    /// Skips due times up to `time`.
    pub fn skip_until(&mut self, time: Instant) {
        self.take(time);
    }

    /// Changes the interval. The next due time is one new interval after the last one served, but not before `now`:
    /// a faster rate takes effect at once, and a slower one is not early.
    #[inline(never)]
    pub fn set_interval(&mut self, interval_us: u64, now: Instant) {
        let interval_us = at_least_1_us(interval_us);
        if interval_us == self.interval_us {
            return;
        }
        // A due time that has passed stays due.
        if self.due > now {
            let last_served = self.due.before_us(self.interval_us());
            self.due = last_served.after_us(interval_us.get()).max(now);
        }
        self.interval_us = interval_us;
    }
}

fn at_least_1_us(interval_us: u64) -> NonZeroU64 {
    NonZeroU64::new(interval_us).unwrap_or(NonZeroU64::MIN)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::time::at_us;

    fn day(utc_s: u32) -> String {
        Day::of(Utc::from_seconds(utc_s)).to_string()
    }

    #[test]
    fn a_day_ends_at_midnight() {
        // As `date -u -d @…` writes them.
        assert_eq!(day(0), "1970-01-01");
        assert_eq!(day(951_782_399), "2000-02-28");
        assert_eq!(day(951_782_400), "2000-02-29");
        assert_eq!(day(1_795_651_199), "2026-11-25");
        assert_eq!(day(1_795_651_200), "2026-11-26");
        assert_eq!(day(u32::MAX), "2106-02-07");
        let _ = Day::of(Utc::from_micros(u64::MAX));
    }

    #[test]
    fn each_day_follows_the_one_before() {
        const SECONDS_PER_DAY: u32 = 24 * 3_600;
        let mut days = (0..=u32::MAX / SECONDS_PER_DAY).map(|number| day(number * SECONDS_PER_DAY));
        for year in 1_970..2_106 {
            let february = match year {
                2_100 => 28,
                _ if year % 4 == 0 => 29,
                _ => 28,
            };
            let lengths = [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
            for (month, length) in (1..).zip(lengths) {
                for day in 1..=length {
                    let expected = format!("{year}-{month:02}-{day:02}");
                    assert_eq!(days.next().expect("some are left"), expected);
                }
            }
        }
    }

    #[test]
    fn due_times_do_not_drift_with_late_service() {
        let mut cadence = Cadence::starting_at(Instant::EPOCH, 100);
        for tick in 0..1000u64 {
            let late = tick * 7 % 100;
            assert!(cadence.take(at_us(tick * 100 + late)), "tick {tick} not due");
            assert!(!cadence.take(at_us(tick * 100 + late)), "tick {tick} due twice");
        }
        assert_eq!(cadence.due(), at_us(100_000));
    }

    #[test]
    fn missed_intervals_are_skipped_and_the_phase_kept() {
        let mut cadence = Cadence::starting_at(at_us(50), 100);
        assert!(cadence.take(at_us(50)));
        assert!(cadence.take(at_us(471)));
        assert_eq!(cadence.due(), at_us(550));
        assert!(!cadence.take(at_us(549)));
    }

    #[test]
    fn skipped_due_times_are_not_caught_up() {
        let mut cadence = Cadence::starting_at(at_us(50), 100);
        cadence.skip_until(at_us(480));
        assert_eq!(cadence.due(), at_us(550));
        cadence.skip_until(at_us(500));
        assert_eq!(cadence.due(), at_us(550));
    }

    #[test]
    fn a_faster_interval_takes_effect_at_once() {
        let mut cadence = Cadence::starting_at(Instant::EPOCH, 1_000);
        assert!(cadence.take(Instant::EPOCH));
        cadence.set_interval(100, at_us(50));
        assert_eq!(cadence.due(), at_us(100));
        cadence.set_interval(1_000, at_us(60));
        assert_eq!(cadence.due(), at_us(1_000));
    }

    #[test]
    fn changing_the_interval_keeps_a_due_time_due() {
        let mut cadence = Cadence::starting_at(at_us(500), 100);
        cadence.set_interval(1_000, at_us(500));
        assert!(cadence.take(at_us(500)));
    }

    proptest! {
        #[test]
        fn the_next_due_time_is_always_ahead_and_in_phase(
            start in 0u64..1 << 40, interval in 1u64..1 << 32, late in 0u64..1 << 44,
        ) {
            let start = at_us(start);
            let mut cadence = Cadence::starting_at(start, interval);
            let now = start.after_us(late);
            prop_assert!(cadence.take(now));
            prop_assert!(cadence.due() > now);
            prop_assert!(cadence.due().us_since(now) <= interval);
            prop_assert_eq!(cadence.due().us_since(start) % interval, 0);
        }
    }
}
