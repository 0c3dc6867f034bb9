//! EV: events.

use super::format::Kind;
use super::packet::{Packet, RecordBytes};

/// An event, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum EventId {
    /// The rover was armed.
    Armed = 10,
    /// The rover was disarmed.
    Disarmed = 11,
}

pub(super) fn encode(time_us: u64, event: EventId) -> RecordBytes {
    Packet::at(Kind::Event, time_us).u8(event as u8).finish()
}
