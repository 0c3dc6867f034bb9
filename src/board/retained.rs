//! RAM that keeps its content over a reset of the processor.
#![expect(
    unsafe_code,
    reason = "the section has no initialiser, and its content is only bytes until it was checked"
)]

use core::array;
use core::mem::MaybeUninit;

use core::sync::atomic::{AtomicU32, Ordering};

use super::ResetReason;
use crate::battery::{RetainedMemory, RetainedRecord};

/// Words for a static in `.uninit`: what they hold at the start is what they held before it, or anything. They can be
/// written by the fault handler, too.
pub(super) struct RetainedWords<const N: usize>([AtomicU32; N]);

impl<const N: usize> RetainedWords<N> {
    /// The zeros are for the compiler: they are never written.
    pub const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; N])
    }

    pub fn get(&self) -> [u32; N] {
        array::from_fn(|at| self.0.get(at).map_or(0, |word| word.load(Ordering::Relaxed)))
    }

    pub fn set(&self, words: [u32; N]) {
        for (to, from) in self.0.iter().zip(words) {
            to.store(from, Ordering::Relaxed);
        }
    }
}

/// `.uninit` is neither cleared nor copied at start-up.
#[unsafe(link_section = ".uninit.BATTERY_MEMORY")]
static mut BATTERY_MEMORY: MaybeUninit<RetainedMemory> = MaybeUninit::uninit();

/// What the firmware before this start has retained: records that have yet to be checked. After a power cycle, or when
/// RUN was pressed, there is nothing to continue from: another pack may be plugged in.
///
/// It may be called once: `main` does.
// Inlined, it would add to the stack of everything `main` calls.
#[inline(never)]
pub fn retained_memory(reset_reason: ResetReason) -> &'static mut RetainedMemory {
    let memory = &raw mut BATTERY_MEMORY;
    match reset_reason {
        ResetReason::WatchdogTimeout
        | ResetReason::Fault
        | ResetReason::Software
        | ResetReason::Processor => {}
        ResetReason::PowerOn | ResetReason::RunPin | ResetReason::Debugger => {
            // SAFETY: no other reference exists: this is called once, before the tasks run.
            unsafe { memory.write(MaybeUninit::new([RetainedRecord::BLANK; 2])) };
        }
    }
    // SAFETY: no other reference exists, as above. The records are plain words, of which every bit pattern is valid; the
    // RAM behind them has been written since power came on, by the firmware before this start.
    unsafe { (*memory).assume_init_mut() }
}
