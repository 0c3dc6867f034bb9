//! Something that has to keep coming once it has begun.

use crate::battery::ArmState;

/// Watches something that has to keep coming once it has begun.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    last_us: Option<u64>,
    has_failed: bool,
}

impl Watch {
    /// It came.
    pub fn seen(&mut self, now_us: u64) {
        *self = Self {
            last_us: Some(now_us),
            has_failed: false,
        };
    }

    /// Whether it comes.
    pub fn is_alive(&self) -> bool {
        self.last_us.is_some()
    }

    /// Whether it stayed away while the rover was armed, and has not come again.
    pub fn has_failed(&self) -> bool {
        self.has_failed
    }

    /// The rover is disarmed: nothing depends on it any more.
    pub fn forgive(&mut self) {
        self.has_failed = false;
    }

    /// Whether it fails now. What falls silent while the rover is disarmed need not come until it has begun again.
    pub fn fails(&mut self, now_us: u64, timeout_us: u64, arm_state: ArmState) -> bool {
        let is_silent = self
            .last_us
            .is_some_and(|last_us| now_us.saturating_sub(last_us) > timeout_us);
        if !is_silent {
            return false;
        }
        self.last_us = None;
        self.has_failed = arm_state == ArmState::Armed;
        self.has_failed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_fails_once_when_what_had_begun_stays_away_while_armed() {
        let mut watch = Watch::default();
        assert!(!watch.fails(9_000_000, 1_000_000, ArmState::Armed));
        watch.seen(9_000_000);
        assert!(!watch.fails(10_000_000, 1_000_000, ArmState::Armed));
        assert!(watch.fails(10_000_001, 1_000_000, ArmState::Armed));
        assert!(watch.has_failed() && !watch.is_alive());
        assert!(!watch.fails(20_000_000, 1_000_000, ArmState::Armed));
        watch.seen(20_000_000);
        assert!(watch.is_alive() && !watch.has_failed());
    }

    #[test]
    fn what_falls_silent_while_disarmed_is_no_failure_later() {
        let mut watch = Watch::default();
        watch.seen(0);
        assert!(!watch.fails(2_000_000, 1_000_000, ArmState::Disarmed));
        assert!(!watch.fails(3_000_000, 1_000_000, ArmState::Armed));
        assert!(!watch.has_failed());
    }
}
