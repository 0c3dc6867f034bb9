//! The date of a log file.

use core::num::NonZeroU32;

use super::stream::Stream;
use crate::recorder::dataflash::Record;
use crate::time::{Instant, Utc};

/// The known part of a date.
#[derive(Debug, Default)]
pub struct Date {
    /// When the board started.
    started: Option<Utc>,
    /// When the open file began, in seconds since 1970, once that is recorded in it.
    pub file_began_utc_s: Option<NonZeroU32>,
}

impl Date {
    /// It is this time in UTC at `now`.
    pub fn set_time(&mut self, utc: Utc, now: Instant) {
        self.started = Some(utc.before_us(now.as_micros()));
    }

    /// Records in the open file, once, what time it is at `now`, if that is known.
    pub fn record(&mut self, stream: &mut Stream, now: Instant) {
        let (Some(started), None) = (self.started, self.file_began_utc_s) else {
            return;
        };
        let utc_at = |moment: Instant| started.after_us(moment.as_micros());
        let began_utc_s = utc_at(stream.began()).seconds();
        let record = Record::Time(utc_at(now)).encode(now.as_micros());
        // Without room for it, there is some a moment later.
        if began_utc_s.is_some() && stream.add(&record) {
            self.file_began_utc_s = began_utc_s;
        }
    }
}
