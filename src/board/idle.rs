//! How long the executor has slept and which task it runs, from its trace hooks.
//!
//! The executor calls the hooks by name. Time spent in interrupt handlers while it sleeps counts as idle.
#![expect(
    unsafe_code,
    reason = "the executor finds its trace hooks by their unmangled names"
)]

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_rp::pac;

use super::running;
use crate::tasks::IdleTime;

static IDLE_US: AtomicU32 = AtomicU32::new(0);
static ASLEEP_SINCE_US: AtomicU32 = AtomicU32::new(0);

/// The idle time of the thread-mode executor.
pub struct ExecutorIdleTime;

impl IdleTime for ExecutorIdleTime {
    fn idle_us(&self) -> u32 {
        IDLE_US.load(Ordering::Relaxed)
    }
}

/// The low half of the free-running microsecond timer, without the latch the time driver uses.
fn now_us() -> u32 {
    pac::TIMER.timerawl().read()
}

// SAFETY (of the names below): they are the executor's own, declared in embassy-executor's `raw::trace` with these
// signatures, and nothing else in the program defines them.

#[unsafe(no_mangle)]
fn _embassy_trace_executor_idle(_executor_id: u32) {
    ASLEEP_SINCE_US.store(now_us(), Ordering::Relaxed);
}

#[unsafe(no_mangle)]
fn _embassy_trace_poll_start(_executor_id: u32) {
    let asleep_us = now_us().wrapping_sub(ASLEEP_SINCE_US.load(Ordering::Relaxed));
    let idle_us = IDLE_US.load(Ordering::Relaxed);
    IDLE_US.store(idle_us.wrapping_add(asleep_us), Ordering::Relaxed);
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_new(_executor_id: u32, _task_id: u32) {}

#[unsafe(no_mangle)]
fn _embassy_trace_task_end(_executor_id: u32, _task_id: u32) {}

#[unsafe(no_mangle)]
fn _embassy_trace_task_exec_begin(_executor_id: u32, task_id: u32) {
    running::note_begin(task_id);
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_exec_end(_executor_id: u32, _task_id: u32) {
    running::note_end();
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_ready_begin(_executor_id: u32, _task_id: u32) {}
