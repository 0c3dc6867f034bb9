//! RAM that keeps its content over a reset of the processor.
#![expect(
    unsafe_code,
    reason = "the section has no initialiser, and its content is only bytes until it was checked"
)]

use core::mem::MaybeUninit;

use super::ResetReason;
use crate::battery::{RetainedMemory, RetainedRecord};

/// `.uninit` is neither cleared nor copied at start-up.
#[unsafe(link_section = ".uninit.BATTERY_MEMORY")]
static mut BATTERY_MEMORY: MaybeUninit<RetainedMemory> = MaybeUninit::uninit();

/// What the firmware before this start has retained: records that have yet to be checked. After a power cycle, or when
/// somebody has pressed RUN, there is nothing to go on with: another pack may be plugged in.
///
/// It may be called once: `main` does.
// Inlined, it would add to the stack of everything `main` calls.
#[inline(never)]
pub fn retained_memory(reset_reason: ResetReason) -> &'static mut RetainedMemory {
    let memory = &raw mut BATTERY_MEMORY;
    match reset_reason {
        ResetReason::WatchdogTimeout | ResetReason::Software | ResetReason::Processor => {}
        ResetReason::PowerOn | ResetReason::RunPin | ResetReason::Debugger => {
            // SAFETY: nobody else has a reference: this is called once, before the tasks run.
            unsafe { memory.write(MaybeUninit::new([RetainedRecord::BLANK; 2])) };
        }
    }
    // SAFETY: nobody else has a reference, as above. The records are plain words, of which every bit pattern is valid; the
    // RAM behind them has been written since power came on, by the firmware before this start.
    unsafe { (*memory).assume_init_mut() }
}
