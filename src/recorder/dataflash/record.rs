//! What is recorded.

use super::board::{Health, encode_crash, encode_health};
use super::format::Kind;
use super::pack::{FIRST_CELLS, encode_battery, encode_cells, encode_estimate, encode_more_cells};
use super::packet::{Packet, RecordBytes};
use super::vehicle::{
    ArmingChecks, ArmingMethod, EventId, ModeReason, Subsystem, encode_arming, encode_error, encode_event,
    encode_mode,
};
use crate::battery::{ArmState, BatteryState};
use crate::crash::CrashRecord;
use crate::pack::Pack;
use crate::vehicle::Mode;

/// A record.
#[derive(Clone, Copy, Debug)]
pub enum Record<'a> {
    /// PARM: a parameter.
    Parameter {
        /// Its name, up to 16 characters.
        name: &'a str,
        /// Its value, in its unit.
        value: f32,
        /// Its default, in its unit.
        default: f32,
    },
    /// MSG: a text, cut after 64 bytes.
    Message(&'a str),
    /// EV: an event.
    Event(EventId),
    /// ARM: arming or disarming.
    Arm {
        /// What the rover is now.
        state: ArmState,
        /// The checks in use: `ARMING_CHECK`.
        enabled_checks: u32,
        /// Whether they had to pass.
        checks: ArmingChecks,
        /// What armed or disarmed it.
        method: ArmingMethod,
    },
    /// MODE: a change of the driving mode.
    Mode {
        /// The mode from now on.
        mode: Mode,
        /// Why it changed.
        reason: ModeReason,
    },
    /// ERR: a failsafe begins.
    Error(Subsystem),
    /// BAT: what is measured of a pack.
    Battery(Pack, &'a BatteryState),
    /// BATX: what is estimated of a pack.
    Estimate(Pack, &'a BatteryState),
    /// BCL: the voltages of a pack's first 12 cells.
    Cells(Pack, &'a BatteryState),
    /// BCL2: the voltages of a pack's further cells.
    MoreCells(Pack, &'a BatteryState),
    /// PM: the board's load, and what the log dropped.
    Health(Health),
    /// CRSH: the crash before this start.
    Crash(&'a CrashRecord),
}

impl<'a> Record<'a> {
    /// The records of a pack at one moment; of its cells where they are measured.
    pub fn of_pack(pack: Pack, state: &'a BatteryState) -> impl Iterator<Item = Self> {
        let cells = state.cells.millivolts().len();
        let first_cells = (cells > 0).then_some(Self::Cells(pack, state));
        let more_cells = (cells > FIRST_CELLS).then_some(Self::MoreCells(pack, state));
        [
            Some(Self::Battery(pack, state)),
            Some(Self::Estimate(pack, state)),
            first_cells,
            more_cells,
        ]
        .into_iter()
        .flatten()
    }

    /// The record as it is in a file. `time_us`: since the start.
    pub fn encode(&self, time_us: u64) -> RecordBytes {
        match *self {
            Self::Parameter { name, value, default } => Packet::at(Kind::Parameter, time_us)
                .text::<16>(name)
                .f32(value)
                .f32(default)
                .finish(),
            Self::Message(text) => Packet::at(Kind::Message, time_us).text::<64>(text).finish(),
            Self::Event(event) => encode_event(time_us, event),
            Self::Arm {
                state,
                enabled_checks,
                checks,
                method,
            } => encode_arming(time_us, state, enabled_checks, checks, method),
            Self::Mode { mode, reason } => encode_mode(time_us, mode, reason),
            Self::Error(subsystem) => encode_error(time_us, subsystem),
            Self::Battery(pack, state) => encode_battery(time_us, pack, state),
            Self::Estimate(pack, state) => encode_estimate(time_us, pack, state),
            Self::Cells(pack, state) => encode_cells(time_us, pack, state),
            Self::MoreCells(pack, state) => encode_more_cells(time_us, pack, state),
            Self::Health(health) => encode_health(time_us, health),
            Self::Crash(crash) => encode_crash(time_us, crash),
        }
    }
}
