//! The tasks' clock, which is embassy's.

use embassy_time::Timer;

use crate::time::Instant;

/// This moment, by embassy's clock.
pub fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros())
}

/// Waits until embassy's clock has reached `due`.
pub fn timer_at(due: Instant) -> Timer {
    Timer::at(embassy_time::Instant::from_micros(due.as_micros()))
}

/// Microseconds by the same clock, modulo 2^32: liveness counts so on purpose.
pub(super) fn now_us() -> u32 {
    now().as_micros() as u32
}
