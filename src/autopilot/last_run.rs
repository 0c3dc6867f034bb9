//! The run before this start, as far as its driver has to know of it until the rover is armed again.

use core::ops::Range;

use super::announcement::{CrashLine, Notice};
use super::start::Start;
use crate::announce::Announce;
use crate::crash::{CrashRecord, Interruption, RunEnd, call_sites_text, headline};
use crate::memory::identity::FirmwareHash;

/// The run before this start.
#[derive(Debug)]
pub struct LastRun {
    pub end: RunEnd,
    /// The latest crash.
    pub crash: Option<CrashRecord>,
    /// Address range of the program.
    code: Range<u32>,
}

impl LastRun {
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(start: &Start) -> Self {
        Self {
            end: start.run_end,
            crash: start.crash.clone(),
            code: start.program_code.clone(),
        }
    }

    /// Passes each text about an interruption to `report`. `running` is the program of this run.
    pub fn report(&self, running: Option<FirmwareHash>, report: &mut dyn FnMut(&dyn Announce)) {
        let RunEnd::Interrupted(interruption) = self.end else {
            return;
        };
        match (interruption, &self.crash) {
            (Interruption::Crash, Some(crash)) => {
                report(&CrashLine(&headline(crash, running)));
                if let Some(calls) = call_sites_text(crash, running, self.code.clone()) {
                    report(&CrashLine(&calls));
                }
            }
            (Interruption::Crash, None) => {}
            (Interruption::PowerDip | Interruption::PowerOff, _) => report(&Notice::PowerWentOff),
            (Interruption::Reset, _) => report(&Notice::ResetWhileArmed),
        }
    }
}
