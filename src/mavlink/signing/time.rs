//! The time in signatures: its clock, and how far ahead flash is of it.

use crate::time::Instant;

pub const BYTES: usize = 6;

/// The time in a signature: tens of microseconds since the start of 2015, UTC, in 48 bits.
///
/// Here it is more of a counter: the board has no calendar, and follows those that have one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Timestamp(u64);

impl Timestamp {
    /// Ticks per second.
    pub const PER_SECOND: u64 = 100_000;

    const LATEST: u64 = (1 << (8 * BYTES)) - 1;

    const YEAR: u64 = 365 * 24 * 3600 * Self::PER_SECOND;

    /// The time that is `ticks` of 10 µs after the start of 2015; `None` if that does not fit 48 bits (in 2104).
    pub fn from_ticks(ticks: u64) -> Option<Self> {
        (ticks <= Self::LATEST).then_some(Self(ticks))
    }

    /// The ticks of 10 µs since the start of 2015.
    pub fn ticks(self) -> u64 {
        self.0
    }

    /// This many ticks later; at the end of time it stands still.
    pub(super) fn later(self, ticks: u64) -> Self {
        Self(self.0.saturating_add(ticks).min(Self::LATEST))
    }

    /// Whether there is a year left until the end of time. No sender is followed to a later one: at the end there is no later
    /// frame, and no sender is obeyed any more.
    pub(in crate::mavlink) fn leaves_a_year(self) -> bool {
        self.0 <= Self::LATEST - Self::YEAR
    }

    pub(super) fn from_bytes(bytes: [u8; BYTES]) -> Self {
        let [a, b, c, d, e, f] = bytes;
        Self(u64::from_le_bytes([a, b, c, d, e, f, 0, 0]))
    }

    pub(super) fn to_bytes(self) -> [u8; BYTES] {
        let [a, b, c, d, e, f, ..] = self.0.to_le_bytes();
        [a, b, c, d, e, f]
    }
}

pub const US_PER_TICK: u64 = 10;

/// A clock that never goes back and follows the latest sender.
#[derive(Clone, Debug)]
pub struct SigningClock {
    at_boot: Timestamp,
    /// No two frames have the same.
    last_given: Timestamp,
}

impl SigningClock {
    /// A clock that shows `at_boot` when the board starts.
    pub fn starting_at(at_boot: Timestamp) -> Self {
        Self {
            at_boot,
            last_given: at_boot,
        }
    }

    /// The time it shows at `now`.
    // Not inlined: its division takes much space.
    #[inline(never)]
    pub fn time_at(&self, now: Instant) -> Timestamp {
        self.at_boot
            .later(now.as_micros() / US_PER_TICK)
            .max(self.last_given)
    }

    /// Goes on from `seen` if that is ahead.
    #[inline(never)]
    pub fn follow(&mut self, seen: Timestamp, now: Instant) {
        let ahead = seen.ticks().saturating_sub(self.time_at(now).ticks());
        self.at_boot = self.at_boot.later(ahead);
    }

    /// The time for the next frame, later than that of every frame before.
    pub fn next(&mut self, now: Instant) -> Timestamp {
        self.last_given = self.time_at(now).max(self.last_given.later(1));
        self.last_given
    }
}

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Mark(pub(super) u32);

impl Mark {
    const TICKS: u64 = 1 << 17;

    /// The first one that is far enough ahead of `now`.
    fn ahead_of(now: Timestamp, armed_us: u64) -> Self {
        let ahead = MARK_AHEAD.max(armed_us / US_PER_TICK / SHARE_OF_ARMED_TIME);
        // 48 bits less 17 fit, and so does one more.
        Self(now.later(ahead).ticks().div_ceil(Self::TICKS) as u32)
    }

    pub fn time(self) -> Timestamp {
        Timestamp::default().later(u64::from(self.0).saturating_mul(Self::TICKS))
    }
}

/// The mark that has to replace `stored` when our time is `now`, if it has to be replaced. The vehicle has been armed for
/// `armed_us`, 0 if it is not.
pub fn next_mark(stored: Mark, now: Timestamp, armed_us: u64) -> Option<Mark> {
    let is_near = now.later(MARK_LEFT) > stored.time();
    let next = Mark::ahead_of(now, armed_us);
    (is_near && next != stored).then_some(next)
}

/// The mark that replaces one near the end of time, if the time was taken back from there.
pub fn lower_mark(stored: Mark, now: Timestamp, armed_us: u64) -> Option<Mark> {
    let next = Mark::ahead_of(now, armed_us);
    (next.time().leaves_a_year() && !stored.time().leaves_a_year()).then_some(next)
}
