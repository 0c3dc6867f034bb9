//! Sleep time of the executor and the task it runs, from its trace hooks.
//!
//! The executors call the hooks by name. Time spent in interrupt handlers while the one of the tasks sleeps counts as idle, but
//! for that of the executor in an interrupt.
#![expect(
    unsafe_code,
    reason = "the executor finds its trace hooks by their unmangled names"
)]

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_rp::pac;

use super::{can, running};

static IDLE_US: AtomicU32 = AtomicU32::new(0);
static ASLEEP_SINCE_US: AtomicU32 = AtomicU32::new(0);
static INTERRUPTED_AT_US: AtomicU32 = AtomicU32::new(0);

/// Idle time of the thread-mode executor since boot, in microseconds, modulo 2^32.
pub fn idle_us() -> u32 {
    IDLE_US.load(Ordering::Relaxed)
}

/// The low half of the free-running microsecond timer, without the latch the time driver uses.
fn now_us() -> u32 {
    pac::TIMER.timerawl().read()
}

// SAFETY (of the names below): they are the executor's own, declared in embassy-executor's `raw::trace` with these
// signatures, and nothing else in the program defines them.

#[unsafe(no_mangle)]
fn _embassy_trace_executor_idle(executor_id: u32) {
    if can::is_executor(executor_id) {
        return end_interruption();
    }
    ASLEEP_SINCE_US.store(now_us(), Ordering::Relaxed);
}

#[unsafe(no_mangle)]
fn _embassy_trace_poll_start(executor_id: u32) {
    if can::is_executor(executor_id) {
        return INTERRUPTED_AT_US.store(now_us(), Ordering::Relaxed);
    }
    // Before the time: an interruption in between puts it off.
    let asleep_since_us = ASLEEP_SINCE_US.load(Ordering::Relaxed);
    let asleep_us = now_us().wrapping_sub(asleep_since_us);
    let idle_us = IDLE_US.load(Ordering::Relaxed);
    IDLE_US.store(idle_us.wrapping_add(asleep_us), Ordering::Relaxed);
}

/// Time of the executor in the interrupt does not count as sleep of the other. If that is awake, it does not matter.
fn end_interruption() {
    let took_us = now_us().wrapping_sub(INTERRUPTED_AT_US.load(Ordering::Relaxed));
    let asleep_since_us = ASLEEP_SINCE_US.load(Ordering::Relaxed);
    ASLEEP_SINCE_US.store(asleep_since_us.wrapping_add(took_us), Ordering::Relaxed);
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_new(_executor_id: u32, _task_id: u32) {}

#[unsafe(no_mangle)]
fn _embassy_trace_task_end(_executor_id: u32, _task_id: u32) {}

#[unsafe(no_mangle)]
fn _embassy_trace_task_exec_begin(executor_id: u32, task_id: u32) {
    if can::is_executor(executor_id) {
        running::note_interruption(task_id);
    } else {
        running::note_begin(task_id);
    }
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_exec_end(executor_id: u32, _task_id: u32) {
    if can::is_executor(executor_id) {
        running::note_resumption();
    } else {
        running::note_end();
    }
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_ready_begin(_executor_id: u32, _task_id: u32) {}
