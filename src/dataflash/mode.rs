//! MODE: the driving mode.

use super::format::Kind;
use super::packet::{Packet, RecordBytes};
use crate::vehicle::Mode;

/// Why the mode changed, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ModeReason {
    /// Unknown.
    Unknown = 0,
    /// A command of a ground station.
    Command = 2,
    /// The sticks have timed out.
    ControlsTimedOut = 3,
    /// The battery failsafe.
    BatteryFailsafe = 4,
    /// Heartbeats of ground stations have timed out.
    GroundStationsTimedOut = 5,
}

pub(super) fn encode(time_us: u64, mode: Mode, reason: ModeReason) -> RecordBytes {
    // Manual and Hold are 0 and 4.
    let number = mode.number() as u8;
    Packet::at(Kind::Mode, time_us)
        .u8(number)
        .u8(number)
        .u8(reason as u8)
        .finish()
}
