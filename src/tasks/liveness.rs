//! Task liveness: each task checks in, and the watchdog is fed only while none is overdue.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::vehicle::ArmState;

/// Check-in of a task with its deadline.
///
/// Times are microseconds since boot, modulo 2^32: what is looked at several times a second is noticed long before that.
#[derive(Debug)]
pub struct CheckIn {
    name: &'static str,
    deadline_us: u32,
    deadline_while_armed_us: u32,
    checked_in_us: AtomicU32,
}

impl CheckIn {
    /// The task `name` has to check in at least every `deadline_ms`, 71 minutes at most, first after boot.
    pub const fn new(name: &'static str, deadline_ms: u32) -> Self {
        Self {
            name,
            deadline_us: deadline_ms.saturating_mul(1_000),
            deadline_while_armed_us: deadline_ms.saturating_mul(1_000),
            checked_in_us: AtomicU32::new(0),
        }
    }

    /// This task, with another deadline while the vehicle is armed.
    pub const fn while_armed(self, deadline_ms: u32) -> Self {
        Self {
            deadline_while_armed_us: deadline_ms.saturating_mul(1_000),
            ..self
        }
    }

    /// The task's name, for the log.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Checks in at `now_us`.
    pub fn mark(&self, now_us: u32) {
        self.checked_in_us.store(now_us, Ordering::Relaxed);
    }

    /// Whether the last check-in was longer ago than the deadline.
    pub fn is_overdue(&self, arm_state: ArmState, now_us: u32) -> bool {
        let deadline_us = match arm_state {
            ArmState::Armed => self.deadline_while_armed_us,
            ArmState::Disarmed => self.deadline_us,
        };
        now_us.wrapping_sub(self.checked_in_us.load(Ordering::Relaxed)) > deadline_us
    }
}

/// The first overdue one of `tasks` at `now_us`.
pub fn first_overdue<'a>(tasks: &[&'a CheckIn], arm_state: ArmState, now_us: u32) -> Option<&'a CheckIn> {
    let mut tasks = tasks.iter().copied();
    tasks.find(|task| task.is_overdue(arm_state, now_us))
}

#[cfg(test)]
mod tests {
    use ArmState::{Armed, Disarmed};

    use super::*;

    #[test]
    fn task_is_overdue_after_its_own_deadline() {
        let quick = CheckIn::new("quick", 300);
        let slow = CheckIn::new("slow", 2_000);
        let tasks = [&slow, &quick];
        assert!(first_overdue(&tasks, Disarmed, 300_000).is_none());
        assert_eq!(
            first_overdue(&tasks, Disarmed, 300_001).map(CheckIn::name),
            Some("quick")
        );
        quick.mark(300_001);
        assert!(first_overdue(&tasks, Disarmed, 600_001).is_none());
        quick.mark(1_900_000);
        assert_eq!(
            first_overdue(&tasks, Disarmed, 2_000_001).map(CheckIn::name),
            Some("slow")
        );
    }

    #[test]
    fn microsecond_counter_may_wrap() {
        let task = CheckIn::new("task", 300);
        task.mark(u32::MAX - 99_999);
        assert!(!task.is_overdue(Disarmed, 200_000));
        assert!(task.is_overdue(Disarmed, 200_001));
    }

    #[test]
    fn a_deadline_while_armed_counts_while_armed_only() {
        let drive = CheckIn::new("drive", 500).while_armed(150);
        assert!(!drive.is_overdue(Armed, 150_000));
        assert!(drive.is_overdue(Armed, 150_001));
        assert!(!drive.is_overdue(Disarmed, 500_000));
    }
}
