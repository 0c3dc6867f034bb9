//! Records of the board: PM, its load and what the log dropped; CRSH, the crash before this start.

use core::fmt::Write;

use heapless::String;

use super::format::Kind;
use super::packet::{Packet, RecordBytes};
use crate::crash::{CrashCause, CrashRecord};

/// The board's load, and what the log dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Busy share of the processor over the last second, in tenths of a percent (0 to 1000).
    pub load_permille: u16,
    /// Records since the start that the log could not take.
    pub dropped_records: u32,
}

pub(super) fn encode_health(time_us: u64, health: Health) -> RecordBytes {
    Packet::at(Kind::Health, time_us)
        .u16(health.load_permille)
        .u32(health.dropped_records)
        .finish()
}

/// Characters of the field `Task`.
const TASK_CHARACTERS: usize = 16;

/// Cause 1 is a fault, with its registers; 2 an overdue task; 3 a hang. Without a task, that field is empty.
pub(super) fn encode_crash(time_us: u64, crash: &CrashRecord) -> RecordBytes {
    let (cause, [pc, lr, xpsr]) = match &crash.cause {
        CrashCause::Fault(site) => (1, [site.pc, site.lr, site.xpsr]),
        CrashCause::Overdue => (2, [0; 3]),
        CrashCause::Hung => (3, [0; 3]),
    };
    let mut task = String::<TASK_CHARACTERS>::new();
    if let Some(name) = crash.task {
        // A name is as long at most.
        let _ = write!(task, "{name}");
    }
    Packet::at(Kind::Crash, time_us)
        .u8(cause)
        .u32(pc)
        .u32(lr)
        .u32(xpsr)
        .text::<TASK_CHARACTERS>(&task)
        .finish()
}
