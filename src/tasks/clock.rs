//! The tasks' clock, which is embassy's.

use embassy_time::{TimeoutError, Timer};

use crate::time::Instant;

/// This moment, by embassy's clock.
// Not inlined: it is read in a hundred places.
#[inline(never)]
pub fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros())
}

/// Waits until embassy's clock has reached `due`.
pub fn timer_at(due: Instant) -> Timer {
    Timer::at(by_embassy(due))
}

/// Waits for `future`, until embassy's clock has reached `due` at the latest.
///
/// # Errors
/// It was not ready by then.
pub async fn with_deadline<F: Future>(due: Instant, future: F) -> Result<F::Output, TimeoutError> {
    embassy_time::with_deadline(by_embassy(due), future).await
}

fn by_embassy(time: Instant) -> embassy_time::Instant {
    embassy_time::Instant::from_micros(time.as_micros())
}

/// Microseconds by the same clock, modulo 2^32: liveness counts so on purpose.
pub fn now_us() -> u32 {
    now().as_micros() as u32
}

#[cfg(test)]
mod unit_tests {
    use core::task::Waker;

    use embassy_time_driver::{Driver, time_driver_impl};

    /// Stands still: what waits is tested from outside the library.
    struct StoppedClock;

    time_driver_impl!(static CLOCK: StoppedClock = StoppedClock);

    impl Driver for StoppedClock {
        fn now(&self) -> u64 {
            0
        }

        fn schedule_wake(&self, _: u64, _: &Waker) {
            panic!("a unit test waits for a time that does not come");
        }
    }
}
