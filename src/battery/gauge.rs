//! The pack's own fuel gauge over time: a reading may come without it.

use super::{Gauge, GaugeReading};
use crate::time::Instant;

/// A gauge that has not reported for longer has timed out, in microseconds: more than two of the slowest period of
/// batteries, 5 s.
const TIMEOUT_US: u64 = 12_000_000;

/// What is known of the gauge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum GaugeState {
    /// There is none, or it is not to be used.
    #[default]
    Absent,
    /// It has not reported yet.
    Awaited { since: Instant },
    /// It has not reported in time: the source has none after all.
    NeverHeard,
    /// Its latest report is valid.
    Valid { gauge: Gauge, at: Instant },
    /// It has timed out. Its full capacity stays as it was.
    TimedOut { full_mah: f32 },
}

impl GaugeState {
    /// Takes what a reading at `now` says of it.
    pub fn update(&mut self, now: Instant, reading: GaugeReading) {
        let is_over = |since: Instant| now.us_since(since) > TIMEOUT_US;
        *self = match (reading, *self) {
            (GaugeReading::Absent, _) => Self::Absent,
            (GaugeReading::Read(gauge), _) => Self::Valid { gauge, at: now },
            (GaugeReading::Missing, Self::Absent) => Self::Awaited { since: now },
            (GaugeReading::Missing, Self::Awaited { since }) if is_over(since) => Self::NeverHeard,
            (GaugeReading::Missing, Self::Valid { gauge, at }) if is_over(at) => Self::TimedOut {
                full_mah: gauge.full_mah,
            },
            (GaugeReading::Missing, unchanged) => unchanged,
        };
    }

    /// Its report, until it has timed out.
    pub fn valid(&self) -> Option<&Gauge> {
        match self {
            Self::Valid { gauge, .. } => Some(gauge),
            _ => None,
        }
    }

    /// The pack's full capacity, in milliampere-hours, once it was reported.
    pub fn full_mah(&self) -> Option<f32> {
        match self {
            Self::Valid { gauge, .. } => Some(gauge.full_mah),
            Self::TimedOut { full_mah } => Some(*full_mah),
            Self::Absent | Self::Awaited { .. } | Self::NeverHeard => None,
        }
    }
}
