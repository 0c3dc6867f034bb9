//! PM: how the board does.

use super::format::Kind;
use super::packet::{Packet, RecordBytes};

/// How the board does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Busy share of the processor over the last second, in tenths of a percent (0 to 1000).
    pub load_permille: u16,
    /// Records since the start that the log could not take.
    pub dropped_records: u32,
}

pub(super) fn encode(time_us: u64, health: Health) -> RecordBytes {
    Packet::at(Kind::Health, time_us)
        .u16(health.load_permille)
        .u32(health.dropped_records)
        .finish()
}
