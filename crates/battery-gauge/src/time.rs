//! Moments, and for how long something has lasted.

use core::mem;

/// A moment, in whole microseconds since an arbitrary epoch: on the board since boot. It reads no clock.
///
/// Its arithmetic saturates, so that no pair of moments can make it panic. Intervals are numbers with their unit in the
/// name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Instant {
    us: u64,
}

impl Instant {
    /// The earliest moment, and the default.
    pub const EPOCH: Self = Self::from_micros(0);

    /// The latest moment, 584,000 years later.
    pub const MAX: Self = Self::from_micros(u64::MAX);

    /// The moment `us` microseconds after the epoch.
    pub const fn from_micros(us: u64) -> Self {
        Self { us }
    }

    /// Microseconds since the epoch.
    pub const fn as_micros(self) -> u64 {
        self.us
    }

    /// Microseconds that have passed since `earlier`; 0 if that is later.
    // Inlined, its 64-bit comparison would be repeated at seventy places.
    #[inline(never)]
    pub const fn us_since(self, earlier: Self) -> u64 {
        self.us.saturating_sub(earlier.us)
    }

    /// The moment `us` microseconds later, [`Instant::MAX`] at the latest.
    // Inlined, its 64-bit addition would be repeated at fifty places.
    #[inline(never)]
    pub const fn after_us(self, us: u64) -> Self {
        Self::from_micros(self.us.saturating_add(us))
    }

    /// The moment `us` microseconds earlier, [`Instant::EPOCH`] at the earliest.
    pub const fn before_us(self, us: u64) -> Self {
        Self::from_micros(self.us.saturating_sub(us))
    }
}

/// For tests that work with many moments.
#[cfg(test)]
pub(crate) const fn at_us(us: u64) -> Instant {
    Instant::from_micros(us)
}

/// Time for which something has lasted without a break, in seconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lasting {
    seconds: f32,
}

impl Lasting {
    /// It does not last.
    pub const NONE: Self = Self { seconds: 0.0 };

    /// Whether it has lasted for `required_s`, `dt_s` seconds after the call before; if so, or if it does not last, the
    /// count begins again.
    pub fn reaches(&mut self, required_s: f32, dt_s: f32, lasts: bool) -> bool {
        let seconds = mem::take(&mut self.seconds) + dt_s;
        let is_reached = lasts && seconds >= required_s;
        if lasts && !is_reached {
            self.seconds = seconds;
        }
        is_reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_in_order_from_the_epoch_on() {
        assert_eq!(Instant::default(), Instant::EPOCH);
        assert_eq!(Instant::EPOCH.as_micros(), 0);
        assert!(Instant::EPOCH < at_us(1) && at_us(1) < Instant::MAX);
        assert_eq!(at_us(1 << 40).as_micros(), 1 << 40);
    }

    #[test]
    fn what_is_later_was_no_time_ago() {
        assert_eq!(at_us(1_500).us_since(at_us(500)), 1_000);
        assert_eq!(at_us(500).us_since(at_us(500)), 0);
        assert_eq!(at_us(499).us_since(at_us(500)), 0);
        assert_eq!(Instant::EPOCH.us_since(Instant::MAX), 0);
        assert_eq!(Instant::MAX.us_since(Instant::EPOCH), u64::MAX);
    }

    #[test]
    fn moments_end_at_the_epoch_and_at_the_latest() {
        assert_eq!(at_us(500).after_us(1_000), at_us(1_500));
        assert_eq!(at_us(1_500).before_us(1_000), at_us(500));
        assert_eq!(at_us(1_500).before_us(1_501), Instant::EPOCH);
        assert_eq!(Instant::EPOCH.before_us(u64::MAX), Instant::EPOCH);
        assert_eq!(Instant::MAX.before_us(u64::MAX), Instant::EPOCH);
        assert_eq!(at_us(1).after_us(u64::MAX - 1), Instant::MAX);
        assert_eq!(at_us(1).after_us(u64::MAX), Instant::MAX);
        assert_eq!(Instant::MAX.after_us(1), Instant::MAX);
    }

    #[test]
    fn a_break_begins_the_time_again() {
        let mut lasting = Lasting::default();
        let mut reaches = |lasts| lasting.reaches(1.0, 0.5, lasts);
        assert_eq!(
            [true, false, true, true, true].map(&mut reaches),
            [false, false, false, true, false]
        );
    }
}
