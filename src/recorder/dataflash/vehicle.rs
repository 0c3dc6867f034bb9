//! Records of the rover: ARM, arming and disarming; MODE, its driving mode; EV, events; ERR, failsafes.

use super::format::Kind;
use super::packet::{Packet, RecordBytes};
use crate::battery::ArmState;
use crate::vehicle::Mode;

/// Whether the rover was armed or disarmed with its checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ArmingChecks {
    /// They passed, or none is needed.
    Passed = 0,
    /// By force, whatever they say.
    Forced = 1,
}

/// What armed or disarmed the rover, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ArmingMethod {
    /// A command of a ground station.
    Command = 1,
    /// A failsafe that terminates the drive.
    Termination = 20,
}

/// `enabled_checks`: the checks in use, `ARMING_CHECK`.
pub(super) fn encode_arming(
    time_us: u64,
    state: ArmState,
    enabled_checks: u32,
    checks: ArmingChecks,
    method: ArmingMethod,
) -> RecordBytes {
    let state = match state {
        ArmState::Disarmed => 0,
        ArmState::Armed => 1,
    };
    Packet::at(Kind::Arming, time_us)
        .u8(state)
        .u32(enabled_checks)
        .u8(checks as u8)
        .u8(method as u8)
        .finish()
}

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

pub(super) fn encode_mode(time_us: u64, mode: Mode, reason: ModeReason) -> RecordBytes {
    // Manual and Hold are 0 and 4.
    let number = mode.number() as u8;
    Packet::at(Kind::Mode, time_us)
        .u8(number)
        .u8(number)
        .u8(reason as u8)
        .finish()
}

/// An event, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum EventId {
    /// The rover was armed.
    Armed = 10,
    /// The rover was disarmed.
    Disarmed = 11,
}

pub(super) fn encode_event(time_us: u64, event: EventId) -> RecordBytes {
    Packet::at(Kind::Event, time_us).u8(event as u8).finish()
}

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

pub(super) fn encode_error(time_us: u64, subsystem: Subsystem) -> RecordBytes {
    Packet::at(Kind::Error, time_us)
        .u8(subsystem as u8)
        .u8(OCCURRED)
        .finish()
}
