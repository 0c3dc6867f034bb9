//! Traces of the program that ran before this start.

use embassy_rp::pac::WATCHDOG;

use super::reset::{Predecessor, take_reset_reason};
use super::running::{Notes, take_notes};
use super::{ResetReason, retained};
use crate::crash::{
    CrashCause, CrashRecord, CrashesInARow, DriveMark, RunEnd, StartCause, StartKind, headline,
};
use crate::log::warn;
use crate::vehicle::ArmState;
use crate::wifi::RADIO_TASK;

/// The program that ran before this start.
pub struct LastRun {
    /// Why it ended.
    pub reset_reason: ResetReason,
    /// Its end, for its driver.
    pub end: RunEnd,
    /// The latest crash. It may be older than the last run.
    pub crash: Option<CrashRecord>,
    /// Number of programs that crashed one after the other.
    pub crashes_in_a_row: CrashesInARow,
    cause: StartCause,
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
        let crash = retained::crash();
        let is_of_radio = crash.as_ref().is_some_and(|crash| crash.is_during(RADIO_TASK));
        let cause = cause(reset_reason);
        let start = match cause {
            StartCause::Crash if is_of_radio => StartKind::AfterRadioCrash,
            StartCause::Crash => StartKind::AfterCrash,
            StartCause::Power | StartCause::Reset | StartCause::Request => StartKind::Requested,
        };
        Self {
            reset_reason,
            end: take_end(cause),
            crash,
            crashes_in_a_row: count(|before| before.with(start)),
            cause,
        }
    }

    /// Whether the last run ended by the crash.
    pub fn has_crashed(&self) -> bool {
        self.cause == StartCause::Crash
    }

    /// Logs everything about the crash.
    pub fn log(&self) {
        let Some(crash) = &self.crash else { return };
        warn!("{}", headline(crash, crash.firmware).as_str());
        if let CrashCause::Fault(site) = &crash.cause {
            warn!("xPSR {=u32:#010x}, stack {=[?]:#010x}", site.xpsr, site.stack);
        }
    }
}

fn cause(reset_reason: ResetReason) -> StartCause {
    match reset_reason {
        ResetReason::PowerOn => StartCause::Power,
        ResetReason::WatchdogTimeout | ResetReason::Fault => StartCause::Crash,
        ResetReason::RunPin | ResetReason::Debugger | ResetReason::Processor => StartCause::Reset,
        ResetReason::Software => StartCause::Request,
    }
}

/// The end of the last run. An interruption is marked for the starts until the next arming.
fn take_end(cause: StartCause) -> RunEnd {
    let mark = DriveMark::after(retained::drive_mark(), cause);
    if let Some(mark) = mark {
        retained::set_drive_mark(mark);
    }
    RunEnd::new(mark)
}

/// Marks the state of the drive for the next start. Disarmed, an interruption stays marked.
pub(super) fn mark_drive(arm_state: ArmState) {
    let is_marked_armed = retained::drive_mark() == Some(DriveMark::Armed);
    match (arm_state, is_marked_armed) {
        (ArmState::Armed, false) => retained::set_drive_mark(DriveMark::Armed),
        (ArmState::Disarmed, true) => retained::set_drive_mark(DriveMark::Disarmed),
        _ => {}
    }
}

/// The crash of a program that the watchdog ended.
fn starved(notes: Notes) -> CrashRecord {
    match notes.overdue {
        Some(task) => CrashRecord {
            task: Some(task),
            cause: CrashCause::Overdue,
            firmware: notes.firmware,
        },
        None => CrashRecord {
            task: notes.running,
            cause: CrashCause::Hung,
            firmware: notes.firmware,
        },
    }
}

/// Ends a row of quick crashes when the program has run for long enough.
pub(super) fn end_quick_crashes(uptime_s: u64) {
    count(|before| before.after(uptime_s));
}

/// Changes the counts in the watchdog's scratch register 2, which power-on and RUN clear.
fn count(change: impl FnOnce(CrashesInARow) -> CrashesInARow) -> CrashesInARow {
    let counts = change(CrashesInARow::from_word(WATCHDOG.scratch2().read()));
    WATCHDOG.scratch2().write_value(counts.to_word());
    counts
}
