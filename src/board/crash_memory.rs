//! Where a crash is written down: RAM that keeps its content over every reset, RUN too. What power-on leaves there is no
//! record.
#![expect(unsafe_code, reason = "the section has no initialiser")]

use crate::crash::{CrashRecord, CrashWords};
use crate::memory::retained::RetainedWords;
use crate::tasks::CrashMemory;

const WORDS: usize = size_of::<CrashWords>() / 4;

#[unsafe(link_section = ".uninit.CRASH")]
static CRASH: RetainedWords<WORDS> = RetainedWords::new();

/// Writes a crash down. The latest takes the place of one that was not reported yet: it is what keeps the board from
/// running now, and the log has the other.
pub(super) fn write(record: &CrashRecord) {
    CRASH.set(record.to_words());
}

/// The crash that was not reported yet.
pub(super) fn read() -> Option<CrashRecord> {
    CrashRecord::from_words(&CRASH.get())
}

/// The same, as the task that reports the crash sees it.
pub struct BoardCrashMemory;

impl CrashMemory for BoardCrashMemory {
    fn forget(&mut self) {
        CRASH.set([0; WORDS]);
    }
}
