//! RAM that keeps its content over a reset of the processor: the state of the packs, leases, the record of a crash, and whether
//! the rover was armed.
#![expect(
    unsafe_code,
    reason = "the section has no initialiser, and its content is only bytes until it was checked"
)]

use super::ResetReason;
use crate::battery::{RetainedMemory, RetainedRecord, lose_power};
use crate::crash::{CrashRecord, CrashWords, DriveMark};
use crate::memory::retained::RetainedWords;
use crate::net::RetainedLeases;

/// `.uninit` is neither cleared nor copied at start-up: the zeros are for the compiler.
#[unsafe(link_section = ".uninit.BATTERY_MEMORY")]
static mut BATTERY_MEMORY: RetainedMemory = [RetainedRecord::BLANK; 2];

/// Leases of the access point. Valid after every reset, RUN too: a lease that is too old ends in ten minutes.
#[unsafe(link_section = ".uninit.LEASES")]
pub static RETAINED_LEASES: RetainedLeases = RetainedLeases::new();

/// Records that the firmware before this start has retained, yet to be checked. RAM may outlast a dip of power, but another
/// pack may be plugged in since then. When RUN was pressed, or by a debugger, there is nothing to continue from.
///
/// It may be called once: `main` does.
// Inlined, it would add to the stack of everything `main` calls.
#[inline(never)]
pub fn retained_memory(reset_reason: ResetReason) -> &'static mut RetainedMemory {
    let memory = &raw mut BATTERY_MEMORY;
    // SAFETY: no other reference exists: this is called once, before the tasks run. The records are plain words, of which
    // every bit pattern is valid.
    let memory = unsafe { &mut *memory };
    match reset_reason {
        ResetReason::WatchdogTimeout
        | ResetReason::Fault
        | ResetReason::Software
        | ResetReason::Processor => {}
        ResetReason::PowerOn => lose_power(memory),
        ResetReason::RunPin | ResetReason::Debugger => *memory = [RetainedRecord::BLANK; 2],
    }
    memory
}

const WORDS: usize = size_of::<CrashWords>() / 4;

#[unsafe(link_section = ".uninit.CRASH")]
static CRASH: RetainedWords<WORDS> = RetainedWords::new();

#[unsafe(link_section = ".uninit.DRIVE_MARK")]
static DRIVE_MARK: RetainedWords<3> = RetainedWords::new();

/// State of the drive before this start, or that was noted since.
pub(super) fn drive_mark() -> Option<DriveMark> {
    DriveMark::from_words(&DRIVE_MARK.get())
}

/// Notes the state of the drive for the next start.
pub(super) fn set_drive_mark(mark: DriveMark) {
    DRIVE_MARK.set(mark.to_words());
}

/// Writes a crash down. The latest replaces an older one: it is what keeps the board from running now, and the log has the other.
pub(super) fn write_crash(record: &CrashRecord) {
    CRASH.set(record.to_words());
}

/// The latest crash.
pub(super) fn crash() -> Option<CrashRecord> {
    CrashRecord::from_words(&CRASH.get())
}
