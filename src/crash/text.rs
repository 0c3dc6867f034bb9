//! Crash reports as text.

use core::fmt::{self, Formatter};
use core::ops::Range;

use heapless::String;

use super::{CrashCause, CrashRecord};
use crate::numbers::text;

/// Maximum length of a text, in bytes: two STATUSTEXT.
const TEXT_BYTES: usize = 96;

/// Number of addresses that fit into a text.
const CALL_SITES: usize = 8;

/// Cause, task and addresses for addr2line: "Crash: hard fault in battery, PC 0x10001234 LR 0x10005679".
pub fn headline(record: &CrashRecord) -> String<TEXT_BYTES> {
    // It fits, as a test proves.
    text(format_args!("{}", fmt::from_fn(|f| write_headline(f, record))))
}

fn write_headline(f: &mut Formatter<'_>, record: &CrashRecord) -> fmt::Result {
    let (before, after) = match record.cause {
        CrashCause::Fault(_) => ("hard fault in ", ""),
        CrashCause::Overdue => ("", " was overdue"),
        CrashCause::Hung => ("hung or locked up in ", ""),
    };
    write!(f, "Crash: {before}")?;
    match record.task {
        Some(task) => write!(f, "{task}{after}")?,
        None => write!(f, "no task{after}")?,
    }
    let CrashCause::Fault(site) = &record.cause else {
        return Ok(());
    };
    write!(f, ", PC 0x{:08x} LR 0x{:08x}", site.pc, site.lr)?;
    match site.interrupt() {
        Some(number) => write!(f, " in IRQ {number}"),
        None => Ok(()),
    }
}

/// Probable call sites for addr2line, the innermost first; `None` if there are none. `code` is the program's address
/// range.
pub fn call_sites_text(record: &CrashRecord, code: Range<u32>) -> Option<String<TEXT_BYTES>> {
    let CrashCause::Fault(site) = &record.cause else {
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
        }
    }

    fn ended_by(cause: CrashCause) -> CrashRecord {
        CrashRecord {
            task: TaskName::new("sixteen letters!"),
            cause,
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
            assert_eq!(headline(&record), expected);
        }
    }

    #[test]
    fn call_sites_are_truncated_to_fit() {
        let text = call_sites_text(&fault(None, 0), CODE).unwrap();
        let eight = " 1001abca".repeat(8);
        assert_eq!(text.as_str(), format!("Crash: called from{eight}"));
        assert_eq!(call_sites_text(&fault(None, 0), 0..1), None);
        assert_eq!(call_sites_text(&ended_by(CrashCause::Hung), CODE), None);
    }
}
