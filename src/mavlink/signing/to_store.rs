//! What of signing has to be written to flash.

use super::{SigningKey, Timestamp};

/// A mark is set so far ahead.
const MARK_AHEAD: u64 = 70 * Timestamp::PER_SECOND;

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

/// The mark that has to replace `stored` when our time is `now`, if it has to be replaced.
pub(super) fn next_mark(stored: Mark, now: Timestamp) -> Option<Mark> {
    let is_near = now.later(MARK_LEFT) > stored.time();
    let next = Mark::not_before(now.later(MARK_AHEAD));
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
