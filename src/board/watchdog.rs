//! The chip's watchdog.

use embassy_rp::Peri;
use embassy_rp::peripherals::WATCHDOG;
use embassy_time::{Duration, Instant};

use super::{last_run, running};
use crate::tasks::Watchdog;

/// Longer than the longest time with interrupts off (a flash erase takes up to 400 ms by its datasheet), short enough
/// that a rover which hangs stands within a second.
const TIMEOUT: Duration = Duration::from_millis(1000);

/// The chip's watchdog, running.
pub struct BoardWatchdog(embassy_rp::watchdog::Watchdog);

impl BoardWatchdog {
    /// Starts the watchdog. It pauses while a debugger has stopped the processor.
    pub fn start(peripheral: Peri<'static, WATCHDOG>) -> Self {
        let mut watchdog = embassy_rp::watchdog::Watchdog::new(peripheral);
        watchdog.pause_on_debug(true);
        watchdog.start(TIMEOUT);
        Self(watchdog)
    }
}

impl Watchdog for BoardWatchdog {
    fn feed(&mut self) {
        running::note_overdue(None);
        last_run::end_quick_resets(Instant::now().as_secs());
        self.0.feed(TIMEOUT);
    }

    fn starve(&mut self, overdue: &str) {
        running::note_overdue(Some(overdue));
    }
}
