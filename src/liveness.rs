//! Who is alive: each task checks in, and the watchdog is fed only while nobody is overdue.

use core::sync::atomic::{AtomicU32, Ordering};

/// One task's promise to be seen at least every `deadline_ms`.
///
/// Times are milliseconds since boot, modulo 2^32; differences stay right over the wrap.
#[derive(Debug)]
pub struct CheckIn {
    name: &'static str,
    deadline_ms: u32,
    last_seen_ms: AtomicU32,
}

impl CheckIn {
    /// A task called `name` that checks in at least every `deadline_ms`; it counts as seen at boot.
    pub const fn new(name: &'static str, deadline_ms: u32) -> Self {
        Self {
            name,
            deadline_ms,
            last_seen_ms: AtomicU32::new(0),
        }
    }

    /// The task's name, for the log.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The task is alive at `now_ms`.
    pub fn mark(&self, now_ms: u32) {
        self.last_seen_ms.store(now_ms, Ordering::Relaxed);
    }

    /// Whether the task has not been seen for longer than its deadline.
    pub fn is_overdue(&self, now_ms: u32) -> bool {
        now_ms.wrapping_sub(self.last_seen_ms.load(Ordering::Relaxed)) > self.deadline_ms
    }
}

/// The first of `tasks` that is overdue at `now_ms`.
pub fn first_overdue<'a>(tasks: &[&'a CheckIn], now_ms: u32) -> Option<&'a CheckIn> {
    tasks.iter().find(|task| task.is_overdue(now_ms)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_task_is_overdue_only_after_its_own_deadline() {
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
    fn the_wrap_of_the_millisecond_counter_is_not_a_gap() {
        let task = CheckIn::new("task", 300);
        task.mark(u32::MAX - 99);
        assert!(!task.is_overdue(200));
        assert!(task.is_overdue(201));
    }
}
