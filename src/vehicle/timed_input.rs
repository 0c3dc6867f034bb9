//! An input that times out.

use crate::battery::ArmState;

/// An input that has to keep coming once it has begun, and its latest value.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimedInput<T> {
    latest: Option<Received<T>>,
    has_timed_out: bool,
}

#[derive(Clone, Copy, Debug)]
struct Received<T> {
    at_us: u64,
    value: T,
}

impl<T> Default for TimedInput<T> {
    fn default() -> Self {
        Self {
            latest: None,
            has_timed_out: false,
        }
    }
}

impl<T: Copy> TimedInput<T> {
    /// A value came at `at_us`.
    pub fn receive(&mut self, at_us: u64, value: T) {
        *self = Self {
            latest: Some(Received { at_us, value }),
            has_timed_out: false,
        };
    }

    /// The latest value, unless it is older than the time-out.
    pub fn value(&self) -> Option<T> {
        self.latest.as_ref().map(|latest| latest.value)
    }

    /// Whether it timed out while the rover was armed, and has not come since.
    pub fn has_timed_out(&self) -> bool {
        self.has_timed_out
    }

    /// The rover is disarmed: nothing depends on the input any more.
    pub fn clear_time_out(&mut self) {
        self.has_timed_out = false;
    }

    /// Drops a value that is older than the time-out. Returns whether that is a failure: an input that times out while the
    /// rover is disarmed need not come until it has begun again.
    pub fn times_out(&mut self, now_us: u64, timeout_us: u64, arm_state: ArmState) -> bool {
        let is_old = |latest: &Received<T>| now_us.saturating_sub(latest.at_us) > timeout_us;
        if !self.latest.as_ref().is_some_and(is_old) {
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

    #[test]
    fn an_input_that_had_begun_times_out_once_while_armed() {
        let mut input = TimedInput::default();
        assert!(!input.times_out(9_000_000, 1_000_000, ArmState::Armed));
        input.receive(9_000_000, 7);
        assert!(!input.times_out(10_000_000, 1_000_000, ArmState::Armed));
        assert_eq!(input.value(), Some(7));
        assert!(input.times_out(10_000_001, 1_000_000, ArmState::Armed));
        assert!(input.has_timed_out() && input.value().is_none());
        assert!(!input.times_out(20_000_000, 1_000_000, ArmState::Armed));
        input.receive(20_000_000, 8);
        assert!(input.value() == Some(8) && !input.has_timed_out());
    }

    #[test]
    fn an_input_that_times_out_while_disarmed_is_no_failure_later() {
        let mut input = TimedInput::default();
        input.receive(0, ());
        assert!(!input.times_out(2_000_000, 1_000_000, ArmState::Disarmed));
        assert!(!input.times_out(3_000_000, 1_000_000, ArmState::Armed));
        assert!(!input.has_timed_out());
    }
}
