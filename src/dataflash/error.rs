//! ERR: failsafes.

use super::format::Kind;
use super::packet::{Packet, RecordBytes};

/// What a failsafe is for, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Subsystem {
    /// The sticks have timed out.
    ControlsFailsafe = 5,
    /// The battery failsafe.
    BatteryFailsafe = 6,
    /// Heartbeats of ground stations have timed out.
    GroundStationFailsafe = 8,
}

/// The error has begun, by ArduPilot's number.
const OCCURRED: u8 = 1;

pub(super) fn encode(time_us: u64, subsystem: Subsystem) -> RecordBytes {
    Packet::at(Kind::Error, time_us)
        .u8(subsystem as u8)
        .u8(OCCURRED)
        .finish()
}
