//! The run before this start, as far as its driver has to know of it until the rover is armed again.

use core::mem;
use core::ops::Range;

use super::Autopilot;
use super::announcement::{CrashLine, Notice};
use super::links::notify;
use super::start::Start;
use crate::announce::{Announce, announced_text};
use crate::crash::{CrashRecord, Interruption, RunEnd, call_sites_text, headline};
use crate::mavlink::Endpoint;
use crate::memory::identity::FirmwareHash;
use crate::recorder::dataflash::Record;
use crate::time::Instant;

/// The run before this start.
#[derive(Debug)]
pub struct LastRun {
    end: RunEnd,
    /// The latest crash.
    crash: Option<CrashRecord>,
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
    fn report(&self, running: Option<FirmwareHash>, report: &mut dyn FnMut(&dyn Announce)) {
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

impl Autopilot {
    /// Sends what interrupted the last run on this link only.
    pub(super) fn notify_of_interruption(&self, endpoint: &mut Endpoint) {
        let running = self.identity().firmware_hash;
        self.last_run
            .report(running, &mut |notice| notify(endpoint, notice));
    }

    /// The rover is armed: interruptions are over. One that is still a danger to the drive is announced once more.
    pub(super) fn end_interruption(&mut self, now: Instant) {
        match mem::take(&mut self.last_run.end) {
            RunEnd::Interrupted(Interruption::PowerDip) => self.announce(&Notice::PowerWentOff, now),
            RunEnd::Interrupted(Interruption::Crash) => {
                let crash = self.last_run.crash.take();
                if let Some(crash) = &crash {
                    let text = headline(crash, self.identity().firmware_hash);
                    self.announce(&CrashLine(&text), now);
                }
                // The log may have yet to take it.
                self.last_run.crash = crash;
            }
            _ => {}
        }
    }

    /// Whether the newest log has to show how the last run ended.
    pub fn needs_last_arming(&self) -> bool {
        self.last_run.end == RunEnd::Unknown
    }

    /// The newest log ends while armed.
    pub fn last_run_ended_armed(&mut self, now: Instant) {
        if self.needs_last_arming() {
            self.last_run.end = RunEnd::Interrupted(Interruption::PowerOff);
            self.announce(&Notice::PowerWentOff, now);
        }
    }

    /// Records how the last run ended, as a file begins.
    pub(super) fn record_last_run(&mut self) {
        if self.recording.crash_is_due()
            && let Some(crash) = &self.last_run.crash
        {
            self.recording.add(&Record::Crash(crash));
        }
        if self.last_run.end != RunEnd::Interrupted(Interruption::Crash) {
            let recording = &mut self.recording;
            self.last_run
                .report(None, &mut |notice| recording.add_text(&announced_text(notice)));
        }
    }
}
