//! Input with a time-out.

use super::ArmState;
use crate::time::Instant;

/// Latest value of an input, which expires after a time-out. Monitoring starts with the first value.
#[derive(Clone, Copy, Debug)]
pub struct TimedInput<T> {
    latest: Option<T>,
    /// Of the latest value.
    received_at: Instant,
    has_timed_out: bool,
}

impl<T> Default for TimedInput<T> {
    fn default() -> Self {
        Self {
            latest: None,
            received_at: Instant::EPOCH,
            has_timed_out: false,
        }
    }
}

impl<T: Copy> TimedInput<T> {
    /// A value was received at `at`.
    pub fn receive(&mut self, at: Instant, value: T) {
        *self = Self {
            latest: Some(value),
            received_at: at,
            has_timed_out: false,
        };
    }

    /// The latest value, until it expires.
    pub fn value(&self) -> Option<T> {
        self.latest
    }

    /// When the latest value was received, until it expires.
    pub fn received_at(&self) -> Option<Instant> {
        self.latest.map(|_| self.received_at)
    }

    /// Replaces the latest value, which keeps its age.
    pub fn replace(&mut self, value: T) {
        self.latest = self.latest.map(|_| value);
    }

    /// Whether it timed out while armed, without a value since.
    pub fn has_timed_out(&self) -> bool {
        self.has_timed_out
    }

    /// Clears the failure, on disarming.
    pub fn clear_time_out(&mut self) {
        self.has_timed_out = false;
    }

    /// Drops an expired value. Returns whether that is a failure: while disarmed it is not, and monitoring stops until
    /// the next value.
    // Inlined, it would be repeated for each stick in each use.
    #[inline(never)]
    pub fn times_out(&mut self, now: Instant, timeout_us: u64, arm_state: ArmState) -> bool {
        if self.latest.is_none() || now.us_since(self.received_at) <= timeout_us {
            return false;
        }
        self.latest = None;
        self.has_timed_out = arm_state == ArmState::Armed;
        self.has_timed_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    fn started_input_times_out_once_while_armed() {
        let mut input = TimedInput::default();
        assert!(!input.times_out(at_us(9_000_000), 1_000_000, ArmState::Armed));
        input.receive(at_us(9_000_000), 7);
        assert!(!input.times_out(at_us(10_000_000), 1_000_000, ArmState::Armed));
        assert_eq!(input.value(), Some(7));
        assert!(input.times_out(at_us(10_000_001), 1_000_000, ArmState::Armed));
        assert!(input.has_timed_out() && input.value().is_none());
        assert!(!input.times_out(at_us(20_000_000), 1_000_000, ArmState::Armed));
        input.receive(at_us(20_000_000), 8);
        assert!(input.value() == Some(8) && !input.has_timed_out());
    }

    #[test]
    fn time_out_while_disarmed_is_no_failure() {
        let mut input = TimedInput::default();
        input.receive(Instant::EPOCH, ());
        assert!(!input.times_out(at_us(2_000_000), 1_000_000, ArmState::Disarmed));
        assert!(!input.times_out(at_us(3_000_000), 1_000_000, ArmState::Armed));
        assert!(!input.has_timed_out());
    }
}
