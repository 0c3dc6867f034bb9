//! ERR: failsafes and errors.

use super::format::Kind;
use super::packet::{Packet, RecordBytes};

/// What reports an error, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Subsystem {
    /// The sticks have timed out.
    ControlsFailsafe = 5,
    /// The battery failsafe.
    BatteryFailsafe = 6,
    /// Heartbeats of ground stations have timed out.
    GroundStationFailsafe = 8,
    /// The firmware.
    Firmware = 30,
}

/// Whether an error begins or ends, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ErrorCode {
    /// It has ended.
    Resolved = 0,
    /// It has begun.
    Occurred = 1,
}

pub(super) fn encode(time_us: u64, subsystem: Subsystem, code: ErrorCode) -> RecordBytes {
    Packet::at(Kind::Error, time_us)
        .u8(subsystem as u8)
        .u8(code as u8)
        .finish()
}
