//! Task liveness: each task checks in, and the watchdog is fed only while none is overdue.

use core::sync::atomic::{AtomicU32, Ordering};

/// Check-in of a task with its deadline.
///
/// Times are milliseconds since boot, modulo 2^32.
#[derive(Debug)]
pub struct CheckIn {
    name: &'static str,
    deadline_ms: u32,
    checked_in_ms: AtomicU32,
}

impl CheckIn {
    /// The task `name` has to check in at least every `deadline_ms`, first after boot.
    pub const fn new(name: &'static str, deadline_ms: u32) -> Self {
        Self {
            name,
            deadline_ms,
            checked_in_ms: AtomicU32::new(0),
        }
    }

    /// The task's name, for the log.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Checks in at `now_ms`.
    pub fn mark(&self, now_ms: u32) {
        self.checked_in_ms.store(now_ms, Ordering::Relaxed);
    }

    /// Whether the last check-in was longer ago than the deadline.
    pub fn is_overdue(&self, now_ms: u32) -> bool {
        now_ms.wrapping_sub(self.checked_in_ms.load(Ordering::Relaxed)) > self.deadline_ms
    }
}

/// The first overdue one of `tasks` at `now_ms`.
pub fn first_overdue<'a>(tasks: &[&'a CheckIn], now_ms: u32) -> Option<&'a CheckIn> {
    tasks.iter().find(|task| task.is_overdue(now_ms)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn task_is_overdue_after_its_own_deadline() {
        let quick = CheckIn::new("quick", 300);
        let slow = CheckIn::new("slow", 2_000);
        let tasks = [&slow, &quick];
        assert!(first_overdue(&tasks, 300).is_none());
        assert_eq!(first_overdue(&tasks, 301).map(CheckIn::name), Some("quick"));
        quick.mark(301);
        assert!(first_overdue(&tasks, 601).is_none());
        quick.mark(1_900);
        assert_eq!(first_overdue(&tasks, 2_001).map(CheckIn::name), Some("slow"));
    }

    #[test]
    fn millisecond_counter_may_wrap() {
        let task = CheckIn::new("task", 300);
        task.mark(u32::MAX - 99);
        assert!(!task.is_overdue(200));
        assert!(task.is_overdue(201));
    }
}
