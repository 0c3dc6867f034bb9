//! The date of a log file.

use core::num::NonZeroU32;

use super::{LogStep, Recording, State};
use crate::recorder::dataflash::Record;
use crate::time::{Instant, Utc};

/// What is known of it.
#[derive(Debug, Default)]
pub(super) struct Date {
    /// When the board started.
    started: Option<Utc>,
    /// When the open file began, in seconds since 1970, once that is recorded in it.
    pub file_began_utc_s: Option<NonZeroU32>,
}

impl Recording {
    /// It is this time in UTC at `now`. Counts for the open file, unless it has its date, and for all that follow, until there
    /// is a later word.
    pub fn set_time(&mut self, utc: Utc, now: Instant) {
        self.date.started = Some(utc.before_us(now.as_micros()));
    }

    /// Records once in each file what time it is, if that is known.
    pub(super) fn record_date(&mut self) {
        let is_open = matches!(self.state, State::Recording | State::Paused);
        if !is_open || self.date.file_began_utc_s.is_some() {
            return;
        }
        let Some(started) = self.date.started else {
            return;
        };
        let utc_at = |moment: Instant| started.after_us(moment.as_micros());
        let began_utc_s = utc_at(self.stream.began()).seconds();
        let record = Record::Time(utc_at(self.now)).encode(self.now.as_micros());
        // Without room for it, there is some a moment later.
        if began_utc_s.is_some() && self.stream.add(&record) {
            self.date.file_began_utc_s = began_utc_s;
        }
    }

    /// The program of the date into the open file's first sector, if it is recorded and not there yet.
    pub(super) fn next_date(&mut self) -> Option<LogStep> {
        let program = self.ring.as_mut()?.next_date(self.date.file_began_utc_s?)?;
        Some(LogStep::program(&program))
    }
}
