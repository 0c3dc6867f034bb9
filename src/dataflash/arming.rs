//! ARM: arming and disarming.

use super::format::Kind;
use super::packet::{Packet, RecordBytes};
use crate::battery::ArmState;

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
pub(super) fn encode(
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
