//! The content of a log, the same for every format that can be read.

use std::io;

use rover_battmon::battery::{Extremes, FailsafeLevel, FailsafeTimer, LEARNT_WORDS};
use rover_battmon::pack::Pack;
use rover_battmon::vehicle::ArmState;

use crate::trace::Sample;

/// Words of the learnt curve of a pack's cells.
pub const CURVE_WORDS: usize = 5;

/// An entry of a log.
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
    /// Cells that belong to the reading before.
    Cells(Pack, Cells),
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
    /// The id of another vehicle, whose packs are not read.
    OtherSystem(u8),
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

/// Voltages of cells that follow each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// Which part of the pack they are.
    pub part: Part,
    /// Their voltages, in millivolts, as far as there are cells.
    pub millivolts: Vec<u16>,
}

/// A part of a pack's cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The first ones.
    First,
    /// The packs behind the first ones.
    Further,
}

/// The entries of a log in their order, and how much of it was readable. After an error there are no more.
pub trait Entries: Iterator<Item = io::Result<Entry>> {
    /// Bytes so far, of entries and others.
    fn read_bytes(&self) -> u64;

    /// Bytes so far that belong to no entry.
    fn skipped_bytes(&self) -> u64;

    /// Readings so far that were skipped, since their times step back.
    fn stepped_back(&self) -> u64 {
        0
    }
}
