//! Periodic due times without drift or catch-up bursts.

use core::num::NonZeroU64;

/// Due times at a fixed interval.
///
/// Each due time is the previous one plus the interval, however late it was served, so the long-term rate is exact.
/// Missed intervals are skipped, and the phase is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cadence {
    interval_us: NonZeroU64,
    due_us: u64,
}

impl Cadence {
    /// First due at `start_us`, then every `interval_us`, at least 1 µs.
    pub fn starting_at(start_us: u64, interval_us: u64) -> Self {
        Self {
            interval_us: at_least_1_us(interval_us),
            due_us: start_us,
        }
    }

    /// Next due time, in µs.
    pub fn due_us(&self) -> u64 {
        self.due_us
    }

    /// Interval, in µs.
    pub fn interval_us(&self) -> u64 {
        self.interval_us.get()
    }

    /// Whether it is due at `now_us`; if so, advances to the next due time.
    pub fn take(&mut self, now_us: u64) -> bool {
        if now_us < self.due_us {
            return false;
        }
        self.due_us = self.due_us.saturating_add(self.interval_us());
        if self.due_us <= now_us {
            let missed = (now_us - self.due_us) / self.interval_us + 1;
            self.due_us = self
                .due_us
                .saturating_add(missed.saturating_mul(self.interval_us()));
        }
        true
    }

    /// Skips due times up to `time_us`.
    pub fn skip_until(&mut self, time_us: u64) {
        self.take(time_us);
    }

    /// Changes the interval. The next due time is one new interval after the last one served, but not before `now_us`:
    /// a faster rate takes effect at once, and a slower one is not early.
    pub fn set_interval(&mut self, interval_us: u64, now_us: u64) {
        let interval_us = at_least_1_us(interval_us);
        if interval_us == self.interval_us {
            return;
        }
        // A due time that has passed stays due.
        if self.due_us > now_us {
            let last_served_us = self.due_us.saturating_sub(self.interval_us());
            self.due_us = last_served_us.saturating_add(interval_us.get()).max(now_us);
        }
        self.interval_us = interval_us;
    }
}

fn at_least_1_us(interval_us: u64) -> NonZeroU64 {
    NonZeroU64::new(interval_us).unwrap_or(NonZeroU64::MIN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn due_times_do_not_drift_with_late_service() {
        let mut cadence = Cadence::starting_at(0, 100);
        for tick in 0..1000u64 {
            let late = tick * 7 % 100;
            assert!(cadence.take(tick * 100 + late), "tick {tick} not due");
            assert!(!cadence.take(tick * 100 + late), "tick {tick} due twice");
        }
        assert_eq!(cadence.due_us(), 100_000);
    }

    #[test]
    fn missed_intervals_are_skipped_and_the_phase_kept() {
        let mut cadence = Cadence::starting_at(50, 100);
        assert!(cadence.take(50));
        assert!(cadence.take(471));
        assert_eq!(cadence.due_us(), 550);
        assert!(!cadence.take(549));
    }

    #[test]
    fn skipped_due_times_are_not_caught_up() {
        let mut cadence = Cadence::starting_at(50, 100);
        cadence.skip_until(480);
        assert_eq!(cadence.due_us(), 550);
        cadence.skip_until(500);
        assert_eq!(cadence.due_us(), 550);
    }

    #[test]
    fn a_faster_interval_takes_effect_at_once() {
        let mut cadence = Cadence::starting_at(0, 1_000);
        assert!(cadence.take(0));
        cadence.set_interval(100, 50);
        assert_eq!(cadence.due_us(), 100);
        cadence.set_interval(1_000, 60);
        assert_eq!(cadence.due_us(), 1_000);
    }

    #[test]
    fn changing_the_interval_keeps_a_due_time_due() {
        let mut cadence = Cadence::starting_at(500, 100);
        cadence.set_interval(1_000, 500);
        assert!(cadence.take(500));
    }

    proptest! {
        #[test]
        fn the_next_due_time_is_always_ahead_and_in_phase(
            start in 0u64..1 << 40, interval in 1u64..1 << 32, late in 0u64..1 << 44,
        ) {
            let mut cadence = Cadence::starting_at(start, interval);
            let now = start + late;
            prop_assert!(cadence.take(now));
            prop_assert!(cadence.due_us() > now);
            prop_assert!(cadence.due_us() - now <= interval);
            prop_assert_eq!((cadence.due_us() - start) % interval, 0);
        }
    }
}
