//! How long a run may take on this machine. A long one that has used it up does less, and prints so.

// Each program that includes this uses a part of it.
use std::time::{Duration, Instant};

#[derive(Clone, Copy)]
pub struct Budget {
    /// `None`: no limit.
    end: Option<Instant>,
}

impl Budget {
    pub const UNLIMITED: Self = Self { end: None };

    pub fn of(length: Duration) -> Self {
        Self {
            end: Instant::now().checked_add(length),
        }
    }

    /// Half of what is left, so that others get their share.
    pub fn half(self) -> Self {
        let half = |end: Instant| Instant::now() + end.saturating_duration_since(Instant::now()) / 2;
        Self {
            end: self.end.map(half),
        }
    }

    pub fn is_used_up(self) -> bool {
        self.end.is_some_and(|end| Instant::now() >= end)
    }

    /// The items that there is time for.
    pub fn limit<I: Iterator>(self, items: I, what: &str) -> impl Iterator<Item = I::Item> {
        items.enumerate().map_while(move |(done, item)| {
            if self.is_used_up() {
                println!("{what}: the time budget is used up after {done}");
                return None;
            }
            Some(item)
        })
    }
}
