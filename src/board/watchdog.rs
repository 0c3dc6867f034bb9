//! The chip's watchdog.

use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_rp::peripherals::WATCHDOG;
use embassy_rp::{Peri, pac};
use embassy_time::{Duration, Instant};

use super::{alarm_watch, last_run, running};
use crate::tasks::Watchdog;
use crate::vehicle::ArmState;

/// While disarmed. Longer than the longest time with interrupts off: a flash erase takes up to 400 ms by its datasheet.
const TIMEOUT: Duration = Duration::from_millis(1000);

/// While armed, when nothing is erased: a rover that hangs stands before it has gone far.
const TIMEOUT_WHILE_ARMED: Duration = Duration::from_millis(250);

/// Ten times of what reading the flash takes with an erase as slow as the chip's datasheet permits.
const LONGEST_BOOT: Duration = Duration::from_secs(5);

/// The chip's watchdog, running.
pub struct BoardWatchdog(embassy_rp::watchdog::Watchdog);

impl BoardWatchdog {
    /// Starts the watchdog. A debugger does not pause it, and does not stop the time either: while the processor is
    /// halted, the motors run on.
    pub fn start(peripheral: Peri<'static, WATCHDOG>) -> Self {
        let mut watchdog = embassy_rp::watchdog::Watchdog::new(peripheral);
        watchdog.pause_on_debug(false);
        pac::TIMER.dbgpause().write_value(pac::timer::regs::Dbgpause(0));
        watchdog.start(TIMEOUT);
        Self(watchdog)
    }

    /// Feeds it each time `boot` yields, which it does between two flash operations; for five seconds at most. A flash
    /// operation that never ends, and a boot that doesn't, are ended by a reset.
    pub async fn feed_during<T>(&mut self, boot: impl Future<Output = T>) -> T {
        match select(boot, self.feed_until(Instant::now() + LONGEST_BOOT)).await {
            Either::First(booted) => booted,
            Either::Second(never) => never,
        }
    }

    async fn feed_until(&mut self, end: Instant) -> ! {
        loop {
            if Instant::now() < end {
                self.feed(ArmState::Disarmed);
            }
            yield_now().await;
        }
    }
}

impl Watchdog for BoardWatchdog {
    fn feed(&mut self, arm_state: ArmState) {
        running::note_overdue(None);
        alarm_watch::follow(arm_state);
        last_run::end_quick_crashes(Instant::now().as_secs());
        last_run::mark_drive(arm_state);
        self.0.feed(match arm_state {
            ArmState::Armed => TIMEOUT_WHILE_ARMED,
            ArmState::Disarmed => TIMEOUT,
        });
    }

    fn starve(&mut self, overdue: &str) {
        running::note_overdue(Some(overdue));
    }
}
