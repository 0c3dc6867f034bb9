//! Keeps emulated time in step with the wall clock.

use std::thread;
use std::time::{Duration, Instant};

/// What is caught up with. What a slow machine, or one that was asleep, is behind further is left behind.
const CATCH_UP: Duration = Duration::from_millis(100);

pub struct Pace {
    /// When emulated time began, had it been in step ever since.
    began: Instant,
}

impl Pace {
    /// Emulated time begins now.
    pub fn new() -> Self {
        Self {
            began: Instant::now(),
        }
    }

    /// Waits until the wall clock is where emulated time is already.
    pub fn wait(&mut self, emulated: Duration) {
        let due = self.began + emulated;
        let now = Instant::now();
        thread::sleep(due.saturating_duration_since(now));
        self.began += now.saturating_duration_since(due).saturating_sub(CATCH_UP);
    }
}
