//! What of signing has to be written to flash.

use super::clock::US_PER_TICK;
use super::{SigningKey, Timestamp};

/// A mark is set so far ahead.
const MARK_AHEAD: u64 = 70 * Timestamp::PER_SECOND;

/// While the vehicle is armed no sector can be erased, and the marks have to do with the space there is. So they are set
/// ahead by this share of the time armed, if that is more: 159 marks, which an erased sector has room for at least, last
/// for 60 days.
const SHARE_OF_ARMED_TIME: u64 = 16;

/// It is moved when so little is left: once in 62 s, since it takes two records. Between the two, the older mark is still
/// ahead of everything signed.
const MARK_LEFT: u64 = 8 * Timestamp::PER_SECOND;

/// A time which everything signed so far was before, in 2^17 ticks (1.3 s), so that it fits a word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark(pub(super) u32);

impl Mark {
    const TICKS: u64 = 1 << 17;

    /// The first one that is not before `time`.
    fn not_before(time: Timestamp) -> Self {
        // 48 bits less 17 fit, and so does one more.
        Self(time.ticks().div_ceil(Self::TICKS) as u32)
    }

    pub fn time(self) -> Timestamp {
        Timestamp::default().later(u64::from(self.0).saturating_mul(Self::TICKS))
    }
}

/// The mark that has to replace `stored` when our time is `now`, if it has to be replaced. The vehicle has been armed for
/// `armed_us`, 0 if it is not.
pub(super) fn next_mark(stored: Mark, now: Timestamp, armed_us: u64) -> Option<Mark> {
    let is_near = now.later(MARK_LEFT) > stored.time();
    let ahead = MARK_AHEAD.max(armed_us / US_PER_TICK / SHARE_OF_ARMED_TIME);
    let next = Mark::not_before(now.later(ahead));
    (is_near && next != stored).then_some(next)
}

/// Something that has to be written to flash.
#[derive(Clone, Debug, PartialEq)]
pub enum ToStore {
    /// Nothing, in place of whatever is there. Until a choice follows, this counts as a lost key.
    Nothing,
    /// Another key.
    Key(SigningKey),
    /// That there is no key any more.
    NoKey,
    /// A later time.
    Mark(Mark),
}
