//! A line on the terminal for every ten emulated minutes.

use crate::bench::MINUTE;

const BETWEEN_LINES_US: u64 = 10 * MINUTE;

pub struct Progress {
    run: String,
    from_us: u64,
    due_us: u64,
}

impl Progress {
    /// Begins at `from_us`, by the emulator's clock.
    pub fn new(run: impl Into<String>, from_us: u64) -> Self {
        Self {
            run: run.into(),
            from_us,
            due_us: from_us + BETWEEN_LINES_US,
        }
    }

    /// To be called now and then, with the time that it is.
    pub fn at(&mut self, now_us: u64) {
        if now_us >= self.due_us {
            println!(
                "{}: {} emulated minutes",
                self.run,
                (now_us - self.from_us) / MINUTE
            );
            self.due_us += BETWEEN_LINES_US;
        }
    }
}
