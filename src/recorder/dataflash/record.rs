//! The records, and how each is encoded.

use core::ops::Range;

use super::format::Kind;
use super::packet::{Packet, RecordBytes, finite, whole_pct};
use crate::battery::{
    Amount, BatteryState, Extremes, FailsafeLevel, FailsafeTimer, LearntPack, MAX_CELLS, PackStatus, Reported,
};
use crate::crash::{CrashCause, CrashRecord};
use crate::memory::identity::BoardId;
use crate::numbers::{round_to_i32, text};
use crate::pack::Pack;
use crate::time::Utc;
use crate::vehicle::ArmState;
use crate::vehicle::Mode;

/// Bytes of the text of a [`Record::Message`].
pub const MESSAGE_BYTES: usize = 64;

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
    /// MSG: a text, cut after [`MESSAGE_BYTES`].
    Message(&'a str),
    /// EV: the rover is armed or disarmed.
    Event(ArmState),
    /// ARM: arming or disarming.
    Arm {
        /// The rover's present state.
        state: ArmState,
        /// The checks in use: `ARMING_CHECK`.
        enabled_checks: u32,
        /// Whether it was armed or disarmed by force, whatever the checks say.
        forced: bool,
        /// The cause.
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
    /// BATX: what is estimated of a pack, and its extremes since the BATX before.
    Estimate(Pack, &'a BatteryState, Extremes),
    /// BCL: the voltages of a pack's first 12 cells.
    Cells(Pack, &'a BatteryState),
    /// BCL2: the voltages of a pack's further cells.
    MoreCells(Pack, &'a BatteryState),
    /// PM: the board's load, and what the log dropped.
    Health {
        /// Busy share of the processor over the last second, in tenths of a percent (0 to 1000).
        load_permille: u16,
        /// Records since the start that the log could not take.
        dropped_records: u32,
    },
    /// CRSH: the crash before this start.
    Crash(&'a CrashRecord),
    /// GPS: what time it is. There is no GPS; this is the record by which programs date a log.
    Time(Utc),
    /// BRD: which board it is.
    Board(BoardId),
    /// PACK: which pack it is, and what is learnt of it, if it was read from flash.
    Pack(Pack, &'a BatteryState, Option<&'a LearntPack>),
    /// PCKO: what is learnt of the curve of a pack's cells.
    Curve(Pack, &'a LearntPack),
    /// BATR: report of a pack's own gauge.
    Report(Pack, &'a Reported),
    /// FSTM: the timer of a level of a pack's failsafe starts, is reset or expires.
    FailsafeTimer(Pack, FailsafeLevel, FailsafeTimer),
    /// MAVC: a command that changes something, and its result.
    Command(&'a CommandRecord),
}

/// Bytes of the parameters of a command.
pub const COMMAND_FIELD_BYTES: usize = 28;

/// Fields of COMMAND_LONG or COMMAND_INT and its acknowledgement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandRecord {
    /// `target_system` and `target_component`.
    pub target: [u8; 2],
    /// System and component that have sent it.
    pub sender: [u8; 2],
    /// `frame`, 0 in COMMAND_LONG.
    pub frame: u8,
    /// `command`, a MAV_CMD.
    pub number: u16,
    /// `param1` to `param4`, `x`, `y` and `z` as they are on the wire; of COMMAND_LONG `param5` and `param6` as whole numbers.
    pub fields: [u8; COMMAND_FIELD_BYTES],
    /// A MAV_RESULT.
    pub result: u8,
    /// Whether it was a COMMAND_LONG.
    pub was_long: bool,
}

impl<'a> Record<'a> {
    /// The records of a pack at one moment, with its extremes since the BATX before; of its cells where they are measured.
    pub fn of_pack(pack: Pack, state: &'a BatteryState, extremes: Extremes) -> impl Iterator<Item = Self> {
        let cells = state.cells.count();
        let first_cells = (cells > 0).then_some(Self::Cells(pack, state));
        let more_cells = (cells > FIRST_CELLS).then_some(Self::MoreCells(pack, state));
        [
            Some(Self::Battery(pack, state)),
            Some(Self::Estimate(pack, state, extremes)),
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
                .text(16, name)
                .f32(value)
                .f32(default)
                .finish(),
            Self::Message(text) => Packet::at(Kind::Message, time_us)
                .text(MESSAGE_BYTES, text)
                .finish(),
            Self::Event(state) => Packet::at(Kind::Event, time_us).u8(event_number(state)).finish(),
            Self::Arm {
                state,
                enabled_checks,
                forced,
                method,
            } => Packet::at(Kind::Arming, time_us)
                .u8(u8::from(state == ArmState::Armed))
                .u32(enabled_checks)
                .u8(u8::from(forced))
                .u8(method as u8)
                .finish(),
            Self::Mode { mode, reason } => encode_mode(time_us, mode, reason),
            Self::Error(subsystem) => Packet::at(Kind::Error, time_us)
                .u8(subsystem as u8)
                .u8(OCCURRED)
                .finish(),
            Self::Battery(pack, state) => encode_battery(time_us, pack, state),
            Self::Estimate(pack, state, extremes) => encode_estimate(time_us, pack, state, extremes),
            Self::Cells(pack, state) => encode_cells(time_us, pack, state),
            Self::MoreCells(pack, state) => encode_more_cells(time_us, pack, state),
            Self::Health {
                load_permille,
                dropped_records,
            } => Packet::at(Kind::Health, time_us)
                .u16(load_permille)
                .u32(dropped_records)
                .finish(),
            Self::Crash(crash) => encode_crash(time_us, crash),
            Self::Time(utc) => encode_time(time_us, utc),
            Self::Board(id) => Packet::at(Kind::Board, time_us)
                .text(16, &id.serial_number())
                .finish(),
            Self::Pack(pack, state, learnt) => encode_pack(time_us, pack, state, learnt),
            Self::Curve(pack, learnt) => encode_curve(time_us, pack, learnt),
            Self::Report(pack, reported) => encode_report(time_us, pack, reported),
            // `FS` as in BATX.
            Self::FailsafeTimer(pack, level, timer) => Packet::at(Kind::FailsafeTimer, time_us)
                .u8(pack.instance())
                .u8(level as u8)
                .u8(timer as u8)
                .finish(),
            Self::Command(command) => encode_command(time_us, command),
        }
    }
}

/// Cause of arming or disarming, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ArmingMethod {
    /// A command of a ground station.
    Command = 1,
    /// A failsafe that terminates the drive.
    Termination = 20,
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

/// Subject of a failsafe, with ArduPilot's numbers.
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

/// ArduPilot's numbers of the events.
fn event_number(state: ArmState) -> u8 {
    match state {
        ArmState::Armed => 10,
        ArmState::Disarmed => 11,
    }
}

/// The error has begun, by ArduPilot's number.
const OCCURRED: u8 = 1;

fn encode_mode(time_us: u64, mode: Mode, reason: ModeReason) -> RecordBytes {
    // Manual and Hold are 0 and 4.
    let number = mode.number() as u8;
    Packet::at(Kind::Mode, time_us)
        .u8(number)
        .u8(number)
        .u8(reason as u8)
        .finish()
}

/// A temperature that is unknown, as in ArduPilot.
const TEMPERATURE_UNKNOWN_CDEGC: i16 = 0;

/// A remaining charge that is unknown, as in ArduPilot.
const REMAINING_UNKNOWN_PCT: u8 = u8::MAX;

/// Sentinel of the field `Err`.
const ERROR_UNKNOWN_PCT: u8 = u8::MAX;

/// A state of health that is unknown, as in ArduPilot.
const STATE_OF_HEALTH_UNKNOWN_PCT: u8 = 0;

/// `Volt` is the terminal voltage, whichever is reported to ground stations. Of a tank there is fuel in place of charge and current, in millilitres and litres per hour.
fn encode_battery(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    Packet::at(Kind::Battery, time_us)
        .u8(pack.instance())
        .number(state.readings.voltage_v)
        .number(state.readings.resting_voltage_v)
        .number(state.rate())
        .number(state.consumed.map(Amount::number))
        .number(state.consumed_wh)
        .bytes(&temperature_cdegc(state.temperature_c).to_le_bytes())
        .number(state.resistance_ohm)
        .u8(finite(state.readings.remaining_pct).map_or(REMAINING_UNKNOWN_PCT, whole_pct))
        .u8(u8::from(state.status == PackStatus::Healthy))
        .u8(state.state_of_health_pct.unwrap_or(STATE_OF_HEALTH_UNKNOWN_PCT))
        .finish()
}

/// In hundredths of a degree, saturating at ±327.67 °C. A true 0.00 °C would read as unknown and is recorded as 0.01 °C.
fn temperature_cdegc(temperature_c: Option<f32>) -> i16 {
    let Some(temperature_c) = finite(temperature_c) else {
        return TEMPERATURE_UNKNOWN_CDEGC;
    };
    let limit = i32::from(i16::MAX);
    match round_to_i32(temperature_c * 100.0).clamp(-limit, limit) as i16 {
        TEMPERATURE_UNKNOWN_CDEGC => 1,
        known => known,
    }
}

/// Standard deviations between the estimate and each of its bounds: the truth is within them 19 times of 20.
const DEVIATIONS: f32 = 2.0;

/// `SoC` with its bounds and `Use`, the usable share, in percent; `Cap`, the learnt capacity, in milliampere-hours; `State`
/// and `Flt` by MAVLink's numbers and bits; `FS` by ArduPilot's; `Stat`, see [`status_number`]; `VMin` and `IMax`, the
/// extremes of single conversions, in volts and amperes.
fn encode_estimate(time_us: u64, pack: Pack, state: &BatteryState, extremes: Extremes) -> RecordBytes {
    let remaining_pct = finite(state.readings.remaining_pct);
    let deviation_pct = finite(state.readings.remaining_sigma_pct).map(|sigma_pct| DEVIATIONS * sigma_pct);
    let bounds = remaining_pct.zip(deviation_pct);
    Packet::at(Kind::Estimate, time_us)
        .u8(pack.instance())
        .number(remaining_pct)
        .number(bounds.map(|(pct, deviation_pct)| (pct - deviation_pct).max(0.0)))
        .number(bounds.map(|(pct, deviation_pct)| (pct + deviation_pct).min(100.0)))
        .number(state.readings.usable_pct)
        .number(state.learnt_capacity_mah)
        .u8(state.charge_state as u8)
        .u16(state.faults_to_show().bits())
        .u8(state.failsafe as u8)
        .u8(status_number(state.status))
        .number(extremes.lowest_voltage_v)
        .number(extremes.highest_current_a)
        .finish()
}

fn encode_report(time_us: u64, pack: Pack, reported: &Reported) -> RecordBytes {
    let gauge = &reported.gauge;
    Packet::at(Kind::Report, time_us)
        .u8(pack.instance())
        .u8(gauge.error_pct.unwrap_or(ERROR_UNKNOWN_PCT))
        .u16(gauge.over_discharges.unwrap_or(u16::MAX))
        .number(gauge.energies_wh.map(|[remaining_wh, _]| remaining_wh))
        .number(gauge.energies_wh.map(|[_, full_wh]| full_wh))
        .u8(reported.modes.bits())
        .finish()
}

/// Numbers of the field `Stat`. They stay as they are: files are kept.
fn status_number(status: PackStatus) -> u8 {
    match status {
        PackStatus::Disabled => 0,
        PackStatus::Unknown => 1,
        PackStatus::NotConnected => 2,
        PackStatus::Healthy => 3,
        PackStatus::Unhealthy => 4,
    }
}

/// Cells in BCL; BCL2 has those that follow.
const FIRST_CELLS: usize = 12;

/// A cell that does not exist, as in ArduPilot.
const NO_CELL_MV: u16 = 0;

fn encode_cells(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let mut packet = Packet::at(Kind::Cells, time_us);
    packet.u8(pack.instance()).number(state.readings.voltage_v);
    with_cells(&mut packet, state, 0..FIRST_CELLS)
}

fn encode_more_cells(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let mut packet = Packet::at(Kind::MoreCells, time_us);
    with_cells(packet.u8(pack.instance()), state, FIRST_CELLS..MAX_CELLS)
}

/// Voltages as they are, where ArduPilot adds 1 mV. A cell at 0 V is recorded as 1 mV, since 0 is not a cell.
fn with_cells(packet: &mut Packet, state: &BatteryState, places: Range<usize>) -> RecordBytes {
    let measured = state.cells.millivolts();
    let cells = places.map(|place| {
        measured
            .get(place)
            .map_or(NO_CELL_MV, |cell_mv| (*cell_mv).max(1))
    });
    cells.fold(packet, Packet::u16).finish()
}

/// Characters of the field `Task`.
const TASK_CHARACTERS: usize = 16;

/// Cause 1 is a fault, with its registers; 2 an overdue task; 3 a hang. Without a task, that field is empty.
fn encode_crash(time_us: u64, crash: &CrashRecord) -> RecordBytes {
    let (cause, [pc, lr, xpsr]) = match &crash.cause {
        CrashCause::Fault(site) => (1, [site.pc, site.lr, site.xpsr]),
        CrashCause::Overdue => (2, [0; 3]),
        CrashCause::Hung => (3, [0; 3]),
    };
    // A name is as long at most.
    let task = crash
        .task
        .map(|name| text::<TASK_CHARACTERS>(format_args!("{name}")));
    Packet::at(Kind::Crash, time_us)
        .u8(cause)
        .u32(pc)
        .u32(lr)
        .u32(xpsr)
        .text(TASK_CHARACTERS, &task.unwrap_or_default())
        .finish()
}

fn encode_command(time_us: u64, command: &CommandRecord) -> RecordBytes {
    Packet::at(Kind::Command, time_us)
        .bytes(&command.target)
        .bytes(&command.sender)
        .u8(command.frame)
        .u16(command.number)
        .bytes(&command.fields)
        .u8(command.result)
        .u8(u8::from(command.was_long))
        .finish()
}

/// GPS time began with 1980-01-06, in milliseconds since 1970.
const GPS_EPOCH_MS: u64 = 315_964_800_000;

/// Lead of GPS time over UTC since 2017, when the last leap second was over.
const LEAP_SECONDS_MS: u64 = 18_000;

const WEEK_MS: u64 = 7 * 24 * 60 * 60 * 1000;

/// `Status`: neither a GPS nor a position. Mission Planner takes no time from ArduPilot's 0 to 2, and for 3 and more it draws
/// the position.
const TIME_ONLY: i8 = -1;

/// `HDop`: unknown, as in ArduPilot.
const DILUTION_UNKNOWN: u16 = 9999;

/// `GMS` and `GWk` are GPS time: milliseconds of a week, and the weeks before it. `Lat` and `Lng` 0 are no position.
fn encode_time(time_us: u64, utc: Utc) -> RecordBytes {
    const INSTANCE: u8 = 0;
    const SATELLITES: u8 = 0;
    const POSITION: [u8; 12] = [0; 12];
    const IN_USE: u8 = 0;
    let gps_ms = (utc.as_micros() / 1000 + LEAP_SECONDS_MS).saturating_sub(GPS_EPOCH_MS);
    Packet::at(Kind::Gps, time_us)
        .u8(INSTANCE)
        .bytes(&TIME_ONLY.to_le_bytes())
        .u32((gps_ms % WEEK_MS) as u32)
        .u16((gps_ms / WEEK_MS) as u16)
        .u8(SATELLITES)
        .u16(DILUTION_UNKNOWN)
        .bytes(&POSITION)
        // Speed, course, vertical speed, yaw.
        .number(None)
        .number(None)
        .number(None)
        .number(None)
        .u8(IN_USE)
        .finish()
}

/// `SN`: unknown, as `BATT_SERIAL_NUM` has it.
const NO_SERIAL_NUMBER: i32 = -1;

/// `Cells`: unknown.
const NO_CELL_COUNT: u8 = 0;

/// `Chem` by MAVLink's numbers. `CapD` and `SoCD` are standard deviations, relative to the capacity and to a full pack.
fn encode_pack(time_us: u64, pack: Pack, state: &BatteryState, learnt: Option<&LearntPack>) -> RecordBytes {
    let capacity = learnt.and_then(LearntPack::capacity);
    let resistance = learnt.and_then(LearntPack::cell_resistance);
    let charge = learnt.and_then(LearntPack::last_charge);
    let cell_count = state.cell_count.or_else(|| learnt?.cell_count());
    Packet::at(Kind::Pack, time_us)
        .u8(pack.instance())
        .i32(state.serial_number.unwrap_or(NO_SERIAL_NUMBER))
        .u8(state.chemistry as u8)
        .u8(cell_count.unwrap_or(NO_CELL_COUNT))
        .u16(learnt.map_or(0, LearntPack::drives))
        .number(capacity.map(|capacity| capacity.capacity_mah))
        .number(capacity.map(|capacity| capacity.sigma))
        .number(resistance.map(|resistance| resistance.now_ohm))
        .number(resistance.map(|resistance| resistance.first_ohm))
        .number(charge.map(|charge| charge.soc))
        .number(charge.map(|charge| charge.sigma))
        .number(charge.map(|charge| charge.resting_v))
        .finish()
}

/// All offsets, then all standard deviations, in tenths of a millivolt; a deviation of 0 is not learnt.
fn encode_curve(time_us: u64, pack: Pack, learnt: &LearntPack) -> RecordBytes {
    let mut packet = Packet::at(Kind::Curve, time_us);
    packet.u8(pack.instance());
    let means = learnt.offsets().iter().map(|offset| offset.mean_100uv);
    let deviations = learnt.offsets().iter().map(|offset| offset.sigma_100uv);
    means.chain(deviations).fold(&mut packet, Packet::i16).finish()
}
