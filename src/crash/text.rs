//! Crash reports as text.

use core::fmt::{self, Formatter};
use core::ops::Range;

use heapless::String;

use super::{CrashCause, CrashRecord};
use crate::memory::identity::FirmwareHash;
use crate::numbers::text;

/// Maximum length of a text, in bytes: two STATUSTEXT.
const TEXT_BYTES: usize = 96;

/// Number of addresses that fit into a text.
const CALL_SITES: usize = 8;

/// The firmware that crashed, compared with the one that runs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    /// The one that runs, or it crashed before its hash was known.
    Same,
    Another,
    /// The hash of the one that runs is not known yet.
    Unknown,
}

impl Version {
    fn of(record: &CrashRecord, running: Option<FirmwareHash>) -> Self {
        match (record.firmware, running) {
            (Some(crashed), Some(running)) if crashed != running => Self::Another,
            (Some(_), None) => Self::Unknown,
            _ => Self::Same,
        }
    }
}

/// Cause, task and addresses for addr2line: "Crash: hard fault in battery, PC 0x10001234 LR 0x10005679". Addresses are those of
/// the firmware that is `running` only.
pub fn headline(record: &CrashRecord, running: Option<FirmwareHash>) -> String<TEXT_BYTES> {
    let version = Version::of(record, running);
    // It fits, as a test proves.
    text(format_args!(
        "{}",
        fmt::from_fn(|f| write_headline(f, record, version))
    ))
}

fn write_headline(f: &mut Formatter<'_>, record: &CrashRecord, version: Version) -> fmt::Result {
    let (before, after) = match record.cause {
        CrashCause::Fault(_) => ("hard fault in ", ""),
        CrashCause::Overdue => ("", " was overdue"),
        CrashCause::Hung => ("hung or locked up in ", ""),
    };
    f.write_str(match version {
        Version::Another => "Crash of another version: ",
        Version::Same | Version::Unknown => "Crash: ",
    })?;
    f.write_str(before)?;
    match record.task {
        Some(task) => write!(f, "{task}{after}")?,
        None => write!(f, "no task{after}")?,
    }
    let (CrashCause::Fault(site), Version::Same) = (&record.cause, version) else {
        return Ok(());
    };
    write!(f, ", PC 0x{:08x} LR 0x{:08x}", site.pc, site.lr)?;
    match site.interrupt() {
        Some(number) => write!(f, " in IRQ {number}"),
        None => Ok(()),
    }
}

/// Probable call sites for addr2line, the innermost first; `None` if there are none in the firmware that is `running`. `code` is
/// its address range.
pub fn call_sites_text(
    record: &CrashRecord,
    running: Option<FirmwareHash>,
    code: Range<u32>,
) -> Option<String<TEXT_BYTES>> {
    let (CrashCause::Fault(site), Version::Same) = (&record.cause, Version::of(record, running)) else {
        return None;
    };
    let mut calls = site.call_sites(code).take(CALL_SITES).peekable();
    calls.peek()?;
    let listed = fmt::from_fn(|f| calls.clone().try_for_each(|call| write!(f, " {call:08x}")));
    // They fit.
    Some(text(format_args!("Crash: called from{listed}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crash::{FaultSite, STACK_WORDS, TaskName};

    const CODE: Range<u32> = 0x1000_0100..0x1002_0000;

    fn fault(task: Option<&str>, xpsr: u32) -> CrashRecord {
        CrashRecord {
            task: task.and_then(TaskName::new),
            cause: CrashCause::Fault(FaultSite {
                pc: 0x1000_1234,
                lr: 0x1000_5679,
                xpsr,
                stack: [0x1001_ABCD; STACK_WORDS],
            }),
            firmware: None,
        }
    }

    fn ended_by(cause: CrashCause) -> CrashRecord {
        CrashRecord {
            task: TaskName::new("sixteen letters!"),
            cause,
            firmware: None,
        }
    }

    #[test]
    fn every_crash_has_a_text_that_fits() {
        for (record, expected) in [
            (
                fault(Some("battery"), 0),
                "Crash: hard fault in battery, PC 0x10001234 LR 0x10005679",
            ),
            (
                fault(Some("sixteen letters!"), 16 + 31),
                "Crash: hard fault in sixteen letters!, PC 0x10001234 LR 0x10005679 in IRQ 31",
            ),
            (
                fault(None, 0),
                "Crash: hard fault in no task, PC 0x10001234 LR 0x10005679",
            ),
            (
                ended_by(CrashCause::Overdue),
                "Crash: sixteen letters! was overdue",
            ),
            (
                ended_by(CrashCause::Hung),
                "Crash: hung or locked up in sixteen letters!",
            ),
        ] {
            assert_eq!(headline(&record, None), expected);
        }
    }

    #[test]
    fn call_sites_are_truncated_to_fit() {
        let text = call_sites_text(&fault(None, 0), None, CODE).unwrap();
        let eight = " 1001abca".repeat(8);
        assert_eq!(text.as_str(), format!("Crash: called from{eight}"));
        assert_eq!(call_sites_text(&fault(None, 0), None, 0..1), None);
        assert_eq!(call_sites_text(&ended_by(CrashCause::Hung), None, CODE), None);
    }

    #[test]
    fn addresses_are_those_of_the_firmware_that_runs() {
        let [crashed, another] = [1, 2].map(|word| FirmwareHash::of([word]));
        let record = CrashRecord {
            firmware: Some(crashed),
            ..fault(Some("sixteen letters!"), 0)
        };
        for (running, expected, has_calls) in [
            (
                Some(crashed),
                "Crash: hard fault in sixteen letters!, PC 0x10001234 LR 0x10005679",
                true,
            ),
            (
                Some(another),
                "Crash of another version: hard fault in sixteen letters!",
                false,
            ),
            (None, "Crash: hard fault in sixteen letters!", false),
        ] {
            assert_eq!(headline(&record, running), expected);
            assert_eq!(call_sites_text(&record, running, CODE).is_some(), has_calls);
        }
    }
}
