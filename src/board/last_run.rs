//! What is known of the program that ran before this start.

use embassy_rp::pac::WATCHDOG;

use super::reset::{Predecessor, take_reset_reason};
use super::running::{Notes, take_notes};
use super::{ResetReason, retained};
use crate::crash::{CrashCause, CrashRecord, QuickResets, StartKind, headline};
use crate::log::warn;

/// What is known of the program that ran before this start.
pub struct LastRun {
    /// Why it ended.
    pub reset_reason: ResetReason,
    /// The crash that was not reported to a ground station yet. It may be older than the last run.
    pub crash: Option<CrashRecord>,
    /// How many programs have crashed one soon after the other.
    pub quick_resets: QuickResets,
}

impl LastRun {
    /// Takes what the last program has left. It has to be called once, before any peripheral is used.
    // Inlined, it would add to the stack of everything `main` calls.
    #[inline(never)]
    pub fn take() -> Self {
        let notes = take_notes();
        let predecessor = notes
            .as_ref()
            .map_or(Predecessor::Other, |_| Predecessor::Firmware);
        let reset_reason = take_reset_reason(predecessor);
        if let (ResetReason::WatchdogTimeout, Some(notes)) = (reset_reason, notes) {
            retained::write_crash(&starved(notes));
        }
        Self {
            reset_reason,
            crash: retained::crash(),
            quick_resets: count(reset_reason),
        }
    }

    /// Logs everything about the crash.
    pub fn log(&self) {
        let Some(crash) = &self.crash else { return };
        warn!("{}", headline(crash).as_str());
        if let CrashCause::Fault(site) = &crash.cause {
            warn!("xPSR {=u32:#010x}, stack {=[?]:#010x}", site.xpsr, site.stack);
        }
    }
}

/// The crash of a program that the watchdog ended.
fn starved(notes: Notes) -> CrashRecord {
    match notes.overdue {
        Some(task) => CrashRecord {
            task: Some(task),
            cause: CrashCause::Overdue,
        },
        None => CrashRecord {
            task: notes.running,
            cause: CrashCause::Hung,
        },
    }
}

/// Counts this start in the watchdog's scratch register 2, which power-on and RUN clear.
fn count(reset_reason: ResetReason) -> QuickResets {
    let start = match reset_reason {
        ResetReason::WatchdogTimeout | ResetReason::Fault => StartKind::AfterCrash,
        ResetReason::PowerOn
        | ResetReason::RunPin
        | ResetReason::Debugger
        | ResetReason::Software
        | ResetReason::Processor => StartKind::Requested,
    };
    let resets = QuickResets::counted(WATCHDOG.scratch2().read(), start);
    WATCHDOG.scratch2().write_value(resets.count());
    resets
}

/// Ends a row of quick resets when the program has run for long enough.
pub(super) fn end_quick_resets(uptime_s: u64) {
    if QuickResets::end_after(uptime_s) {
        WATCHDOG.scratch2().write_value(0);
    }
}
