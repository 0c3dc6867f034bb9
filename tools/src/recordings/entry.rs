//! The content of a recording, the same for every format that can be read.

use std::io;

use rover_battmon::battery::{CellVoltages, Extremes, FailsafeLevel, FailsafeTimer, LEARNT_WORDS};
use rover_battmon::pack::Pack;
use rover_battmon::vehicle::ArmState;

/// Words of the learnt curve of a pack's cells.
pub const CURVE_WORDS: usize = 5;

/// An entry of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Seconds since the recorder started; `None` of what has no time.
    pub time_s: Option<f64>,
    /// Its content.
    pub content: Content,
}

/// The content of an entry.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Measurements of a pack, without arming.
    Reading(Pack, Box<Sample>),
    /// The estimates that belong to the reading before.
    Estimate(Pack, Estimate),
    /// Voltages of cells that follow each other and belong to the reading before, in millivolts, as far as there are cells.
    Cells(Pack, Part, Vec<u16>),
    /// The vehicle is armed or disarmed.
    Arming(ArmState),
    /// A report of whether the vehicle is armed, also of one that was armed before the log.
    ArmState(ArmState),
    /// An event that occurs in flight only.
    Airborne,
    /// The value of a parameter.
    Parameter(String, f64),
    /// A failsafe that belongs to no pack acts.
    Failsafe(&'static str),
    /// The failsafe of a pack acts; versions that say which pack and level have a text, too.
    PackFailsafe,
    /// The timer of a level of a pack's failsafe starts, is reset or expires.
    FailsafeTimer(Pack, (FailsafeLevel, FailsafeTimer)),
    /// The vehicle takes another mode for the failsafe of a pack.
    FailsafeMode,
    /// A text to the owner.
    Text(String),
    /// The kind of vehicle: MAVLink's `MAV_TYPE`.
    Vehicle(u8),
    /// The kind of autopilot: MAVLink's `MAV_AUTOPILOT`.
    Autopilot(u8),
    /// The version of its firmware.
    Version(String),
    /// MAVLink's id of the vehicle.
    SystemId(i32),
    /// The id of another vehicle, whose packs are not read, and how many readings it has.
    OtherSystem(u8, u64),
    /// Readings come from MAVLink's SYS_STATUS, since there is no BATTERY_STATUS.
    FromSysStatus,
    /// A reading that is skipped, since its time steps back.
    SteppedBack,
    /// The recorder's clock was set by this many seconds, ahead or back; times of entries go on.
    ClockStep(f64),
    /// The board's serial number.
    Board(String),
    /// When the recorder started, in seconds since 1970 (UTC).
    StartUtc(f64),
    /// The serial number of a pack, if known, and what was learnt of it, as flash holds it.
    Learnt(Pack, Option<i32>, Box<[u32; LEARNT_WORDS]>),
    /// The learnt curve of its cells.
    Curve(Pack, [u32; CURVE_WORDS]),
}

/// The board's estimates of a pack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The sensor works.
    pub is_healthy: bool,
    /// Remaining charge, in percent.
    pub remaining_pct: Option<f32>,
    /// Number of the charge state.
    pub charge_state: Option<u8>,
    /// Bits of the faults.
    pub faults: Option<u16>,
    /// Extremes of single conversions since the estimate before; `None` of a version that records none.
    pub extremes: Option<Extremes>,
}

/// A part of a pack's cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The first ones.
    First,
    /// The packs behind the first ones.
    Further,
}

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds since some start.
    pub time_s: f64,
    /// Between the pack's terminals.
    pub voltage_v: Option<f32>,
    /// Drawn from the pack.
    pub current_a: Option<f32>,
    /// The sensor delivered.
    pub healthy: bool,
    /// The rover may move.
    pub armed: bool,
    /// Of the pack, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Of each cell.
    pub cells: CellVoltages,
    /// The board's own report at this moment, in a log of its own.
    pub reported: Option<Reported>,
}

impl Sample {
    /// One in which nothing was measured.
    pub const NONE: Self = Self {
        time_s: 0.0,
        voltage_v: None,
        current_a: None,
        healthy: true,
        armed: false,
        temperature_c: None,
        cells: CellVoltages::NONE,
        reported: None,
    };
}

/// The board's report of the pack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reported {
    /// Charge drawn, in milliampere-hours.
    pub consumed_mah: Option<f32>,
    /// Energy drawn, in watt-hours.
    pub consumed_wh: Option<f32>,
    /// Remaining charge, in percent: with its fraction where the log has it.
    pub remaining_pct: Option<f32>,
    /// State of health, in percent.
    pub health_pct: Option<f32>,
    /// Number of the charge state.
    pub charge_state: Option<u8>,
    /// Bits of the faults.
    pub faults: Option<u16>,
    /// Extremes of single conversions since the earlier report of them.
    pub extremes: Option<Extremes>,
}

/// Bytes of a recording so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bytes {
    /// All of them.
    pub read: u64,
    /// Bytes of no entry, without the next ones.
    pub skipped: u64,
    /// Bytes of the last record, which the end of the file cuts.
    pub cut: u64,
}

/// The entries of a recording in their order, and how much of it was readable. After an error there are no more.
pub trait Entries: Iterator<Item = io::Result<Entry>> {
    /// Bytes so far.
    fn bytes(&self) -> Bytes;
}
