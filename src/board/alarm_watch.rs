//! Keeps the time driver going if an alarm of the timer is lost.
#![expect(unsafe_code, reason = "an interrupt is enabled")]

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_rp::interrupt;
use embassy_rp::interrupt::InterruptExt;
use embassy_rp::pac::TIMER;

use crate::vehicle::ArmState;

/// The time driver has alarm 0.
const ALARM: usize = 1;

/// Much shorter than the watchdog's time-out while armed.
const INTERVAL_US: u32 = 20_000;

static IS_ARMED: AtomicBool = AtomicBool::new(false);

/// Watches while the rover is armed.
///
/// An alarm that the time driver sets again in its interrupt may be lost if it matches in the same cycle (embassy issue 6528).
/// Then no timer expires until another one is set, which no task does while all of them wait.
pub(super) fn follow(arm_state: ArmState) {
    let is_armed = arm_state == ArmState::Armed;
    let was_armed = IS_ARMED.load(Ordering::Relaxed);
    IS_ARMED.store(is_armed, Ordering::Relaxed);
    if is_armed && !was_armed {
        TIMER.inte().modify(|enabled| enabled.set_alarm(ALARM, true));
        set_next();
        // SAFETY: the handler below uses nothing that a critical section protects.
        unsafe { interrupt::TIMER_IRQ_1.enable() };
    }
}

fn set_next() {
    let next = TIMER.timerawl().read().wrapping_add(INTERVAL_US);
    TIMER.alarm(ALARM).write_value(next);
}

/// Has the time driver look at the time.
#[interrupt]
fn TIMER_IRQ_1() {
    TIMER.intr().write(|raised| raised.set_alarm(ALARM, true));
    if IS_ARMED.load(Ordering::Relaxed) {
        set_next();
        interrupt::TIMER_IRQ_0.pend();
    }
}
