//! RAM that keeps its content over a reset of the processor: the state of the packs, leases, and the record of a crash.
#![expect(
    unsafe_code,
    reason = "the section has no initialiser, and its content is only bytes until it was checked"
)]

use core::mem::MaybeUninit;

use super::ResetReason;
use crate::battery::{RetainedMemory, RetainedRecord};
use crate::crash::{CrashRecord, CrashWords};
use crate::memory::retained::RetainedWords;
use crate::net::RetainedLeases;

/// `.uninit` is neither cleared nor copied at start-up.
#[unsafe(link_section = ".uninit.BATTERY_MEMORY")]
static mut BATTERY_MEMORY: MaybeUninit<RetainedMemory> = MaybeUninit::uninit();

/// Leases of the access point. Valid after every reset, RUN too: a lease that is too old ends in ten minutes.
#[unsafe(link_section = ".uninit.LEASES")]
pub static RETAINED_LEASES: RetainedLeases = RetainedLeases::new();

/// Records that the firmware before this start has retained, yet to be checked. After a power cycle, or when
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

const WORDS: usize = size_of::<CrashWords>() / 4;

#[unsafe(link_section = ".uninit.CRASH")]
static CRASH: RetainedWords<WORDS> = RetainedWords::new();

/// Writes a crash down. The latest takes the place of one that was not reported yet: it is what keeps the board from
/// running now, and the log has the other.
pub(super) fn write_crash(record: &CrashRecord) {
    CRASH.set(record.to_words());
}

/// The crash that was not reported yet.
pub(super) fn crash() -> Option<CrashRecord> {
    CrashRecord::from_words(&CRASH.get())
}

/// The crash was reported.
pub fn forget_crash() {
    CRASH.set([0; WORDS]);
}
