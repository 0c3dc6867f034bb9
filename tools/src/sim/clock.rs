//! Time driver of host builds: real time, scaled real time, or time stepped by a test.
//!
//! embassy-time's `std` driver runs at wall-clock speed only, and a program has a single driver. Stepped time is per
//! thread, so parallel tests don't share it.

use std::cell::RefCell;
use std::future::Future;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, OnceLock};
use std::task::{Context, Poll, Wake, Waker};
use std::thread;
use std::time::Instant as WallInstant;

use embassy_time::Duration;
use embassy_time_driver::Driver;

embassy_time_driver::time_driver_impl!(static DRIVER: HostClock = HostClock::new());

thread_local! {
    static STEPPED: RefCell<Option<SteppedClock>> = const { RefCell::new(None) };
}

/// Runs the clock at `speedup` times wall-clock speed.
///
/// # Errors
/// The clock is already running.
pub fn set_speedup(speedup: f64) -> Result<(), ClockIsRunning> {
    DRIVER
        .start
        .set((WallInstant::now(), speedup))
        .map_err(|_| ClockIsRunning)
}

/// The clock was already running.
#[derive(Debug)]
pub struct ClockIsRunning;

/// Runs `future` for `duration` of stepped time, from time 0, and returns its output if it ended.
pub fn run_for<F: Future>(duration: Duration, future: F) -> Option<F::Output> {
    Stepped::new(future).run_until(duration.as_micros())
}

/// A future with a stepped clock of its own, which begins at 0 and stands still between runs.
///
/// Time stands still while the future is ready and then jumps to its next timer: no waiting, and every run is the same.
pub struct Stepped<F> {
    future: Pin<Box<F>>,
    clock: SteppedClock,
    woken: Arc<WakeFlag>,
}

impl<F: Future> Stepped<F> {
    /// A future that has not begun.
    pub fn new(future: F) -> Self {
        Self {
            future: Box::pin(future),
            clock: SteppedClock::default(),
            woken: Arc::new(WakeFlag(AtomicBool::new(true))),
        }
    }

    /// Runs the future until this time, in µs, and returns its output if it ended before.
    pub fn run_until(&mut self, end_us: u64) -> Option<F::Output> {
        let own = std::mem::take(&mut self.clock);
        let outer = STEPPED.replace(Some(own));
        let output = self.poll_until(end_us);
        self.clock = STEPPED.replace(outer).unwrap_or_default();
        output
    }

    fn poll_until(&mut self, end_us: u64) -> Option<F::Output> {
        let waker = Waker::from(self.woken.clone());
        let mut context = Context::from_waker(&waker);
        loop {
            while self.woken.0.swap(false, Ordering::Relaxed) {
                if let Poll::Ready(output) = self.future.as_mut().poll(&mut context) {
                    return Some(output);
                }
            }
            let due = with_stepped(|clock| clock.jump_to_next_timer(end_us))?;
            for waker in due? {
                waker.wake();
            }
        }
    }
}

struct WakeFlag(AtomicBool);

impl Wake for WakeFlag {
    fn wake(self: Arc<Self>) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// This thread's stepped clock, while there is one.
fn with_stepped<R>(use_clock: impl FnOnce(&mut SteppedClock) -> R) -> Option<R> {
    STEPPED.with(|stepped| stepped.borrow_mut().as_mut().map(use_clock))
}

#[derive(Default)]
struct SteppedClock {
    now_us: u64,
    timers: TimerQueue,
}

impl SteppedClock {
    /// Jumps to the next timer and returns its wakers; `None`, at `end_us`, if there is none before.
    fn jump_to_next_timer(&mut self, end_us: u64) -> Option<Vec<Waker>> {
        let next_us = self.timers.next_us().filter(|next_us| *next_us < end_us);
        let Some(next_us) = next_us else {
            self.now_us = self.now_us.max(end_us);
            return None;
        };
        self.now_us = self.now_us.max(next_us);
        Some(self.timers.take_due(self.now_us))
    }
}

#[derive(Default)]
struct TimerQueue(Vec<(u64, Waker)>);

impl TimerQueue {
    fn add(&mut self, at_us: u64, waker: &Waker) {
        self.0.push((at_us, waker.clone()));
    }

    fn next_us(&self) -> Option<u64> {
        self.0.iter().map(|(at_us, _)| *at_us).min()
    }

    fn take_due(&mut self, now_us: u64) -> Vec<Waker> {
        self.0
            .extract_if(.., |(at_us, _)| *at_us <= now_us)
            .map(|(_, waker)| waker)
            .collect()
    }
}

struct HostClock {
    /// The start, and how many times as fast as the wall clock it has run since.
    start: OnceLock<(WallInstant, f64)>,
    timers: Mutex<TimerQueue>,
    timer_added: Condvar,
    alarm_thread: OnceLock<()>,
}

impl HostClock {
    const fn new() -> Self {
        Self {
            start: OnceLock::new(),
            timers: Mutex::new(TimerQueue(Vec::new())),
            timer_added: Condvar::new(),
            alarm_thread: OnceLock::new(),
        }
    }

    fn start(&self) -> (WallInstant, f64) {
        *self.start.get_or_init(|| (WallInstant::now(), 1.0))
    }

    fn scaled_now_us(&self) -> u64 {
        let (start, speedup) = self.start();
        (start.elapsed().as_secs_f64() * speedup * 1e6) as u64
    }

    /// Wakes due timers, forever.
    fn run_alarms(&self) {
        let mut timers = self.timers.lock().expect("no alarm panics");
        loop {
            let now_us = self.scaled_now_us();
            for waker in timers.take_due(now_us) {
                waker.wake();
            }
            timers = match timers.next_us() {
                Some(next_us) => {
                    let (_, speedup) = self.start();
                    let wait_us = next_us.saturating_sub(now_us) as f64 / speedup;
                    let wait = std::time::Duration::from_micros(wait_us as u64 + 1);
                    let woken = self.timer_added.wait_timeout(timers, wait);
                    woken.expect("no alarm panics").0
                }
                None => self.timer_added.wait(timers).expect("no alarm panics"),
            };
        }
    }
}

impl Driver for HostClock {
    fn now(&self) -> u64 {
        with_stepped(|clock| clock.now_us).unwrap_or_else(|| self.scaled_now_us())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        if with_stepped(|clock| clock.timers.add(at, waker)).is_some() {
            return;
        }
        self.alarm_thread.get_or_init(|| {
            thread::spawn(|| DRIVER.run_alarms());
        });
        let mut timers = self.timers.lock().expect("no alarm panics");
        timers.add(at, waker);
        self.timer_added.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_time::{Instant, Timer};

    #[test]
    fn stepped_time_jumps_from_timer_to_timer() {
        let wall = WallInstant::now();
        let end = run_for(Duration::from_secs(3600), async {
            Timer::after_secs(600).await;
            Timer::after_secs(1200).await;
            Instant::now().as_secs()
        });
        assert_eq!(end, Some(1800));
        assert!(wall.elapsed().as_secs() < 60, "stepped time waited");
    }

    #[test]
    fn unfinished_future_is_dropped_at_the_end() {
        let end = run_for(Duration::from_secs(10), Timer::after_secs(10));
        assert_eq!(end, None);
    }
}
