//! The time in a signature.

pub(super) const BYTES: usize = 6;

/// The time in a signature: tens of microseconds since the start of 2015, UTC, in 48 bits.
///
/// Here it is more of a counter: the board has no calendar, and follows those that have one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Timestamp(u64);

impl Timestamp {
    /// Ticks per second.
    pub const PER_SECOND: u64 = 100_000;

    const LATEST: u64 = (1 << (8 * BYTES)) - 1;

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

    pub(super) fn from_bytes(bytes: [u8; BYTES]) -> Self {
        let [a, b, c, d, e, f] = bytes;
        Self(u64::from_le_bytes([a, b, c, d, e, f, 0, 0]))
    }

    pub(super) fn to_bytes(self) -> [u8; BYTES] {
        let [a, b, c, d, e, f, ..] = self.0.to_le_bytes();
        [a, b, c, d, e, f]
    }
}
