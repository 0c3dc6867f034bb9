//! What the procedures leave for the checks.

use std::collections::BTreeMap;

use super::record::{Received, Record};
use super::session::{Interruption, Restarted};
use crate::mavlink::dialect::{AUTOPILOT_VERSION_DATA, BATTERY_STATUS_DATA, MavMessage, SYS_STATUS_DATA};
use crate::memory::identity::FirmwareHash;
use crate::time::Instant;

/// A part of the check that is run on request only.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Trial<T> {
    /// It was not asked for.
    #[default]
    NotAsked,
    /// It was asked for; the check ended before.
    NotReached,
    /// Its result.
    Done(T),
}

/// The time in which the board was left alone and listened to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Its start.
    pub from: Instant,
    /// Its end.
    pub to: Instant,
}

impl Window {
    /// Whether `at` lies in it.
    pub fn contains(&self, at: Instant) -> bool {
        self.from <= at && at <= self.to
    }
}

/// The board's parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterList {
    /// How many there are, as the board says; `None` if nothing came.
    pub count: Option<u16>,
    /// Names and values by their index.
    pub by_index: BTreeMap<u16, (String, f32)>,
}

impl ParameterList {
    /// The value of a parameter.
    pub fn value(&self, name: &str) -> Option<f32> {
        let mut parameters = self.by_index.values();
        parameters
            .find(|(other, _)| other == name)
            .map(|(_, value)| *value)
    }
}

/// A parameter that was set, to be read after a restart.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptTrial {
    /// Its name.
    pub name: &'static str,
    /// Its value before.
    pub old: f32,
    /// The value it was given.
    pub new: f32,
    /// What the board answered to that.
    pub answered: Option<f32>,
    /// Result of the restart.
    pub restarted: Option<Restarted>,
    /// What was read after it.
    pub read: Option<f32>,
    /// What the board answered when the old value was set again.
    pub restored: Option<f32>,
}

/// A fault that was provoked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultTrial {
    /// When it was asked for.
    pub asked_at: Instant,
    /// Its result.
    pub restarted: Option<Restarted>,
}

/// The shown voltage beside a multimeter's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Calibration {
    /// What the multimeter shows, in volts; `None` if the owner did not say.
    pub measured_v: Option<f32>,
    /// What the board reports, in volts.
    pub shown_v: Option<f32>,
    /// `BATT_VOLT_MULT` at that time.
    pub old: Option<f32>,
    /// What the board answered when the exact value was set; `None` if it was not set.
    pub applied: Option<f32>,
    /// What the board reports since, in volts.
    pub shown_since_v: Option<f32>,
}

impl Calibration {
    /// The value of `BATT_VOLT_MULT` with which the board would show what the multimeter does.
    pub fn exact(&self) -> Option<f32> {
        let shown_v = self.shown_v.filter(|shown_v| *shown_v > 0.0)?;
        Some(self.old? * self.measured_v? / shown_v)
    }
}

/// The motors of a side, in one direction. The firmware drives those of a side alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotorStep {
    /// The left wheels ahead.
    LeftAhead,
    /// The right wheels ahead.
    RightAhead,
    /// The left wheels back.
    LeftBack,
    /// The right wheels back.
    RightBack,
}

impl MotorStep {
    /// All steps, in their order.
    pub const ALL: [Self; 4] = [Self::LeftAhead, Self::RightAhead, Self::LeftBack, Self::RightBack];

    /// "left wheels ahead"
    pub const fn name(self) -> &'static str {
        match self {
            Self::LeftAhead => "left wheels ahead",
            Self::RightAhead => "right wheels ahead",
            Self::LeftBack => "left wheels back",
            Self::RightBack => "right wheels back",
        }
    }
}

/// Result of a motor step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StepResult {
    /// The owner has seen these wheels turn this way, and no other.
    Confirmed,
    /// The owner has seen something else.
    Denied,
    /// The owner did not answer.
    Unanswered,
    /// The rover was not armed; the board's reasons.
    NotArmed(String),
    /// The port was lost while they turned.
    Interrupted,
}

/// Everything the checks judge by.
#[derive(Clone, Debug, Default)]
pub struct Evidence {
    /// What was heard.
    pub record: Record,
    /// The board's system and component id; `None` if none was heard.
    pub board: Option<(u8, u8)>,
    /// Why the check ended early.
    pub ended: Option<Interruption>,
    /// How long its first heartbeat took, in µs.
    pub connected_after_us: u64,
    /// Its version; `None` if it did not answer.
    pub version: Option<AUTOPILOT_VERSION_DATA>,
    /// The firmware's hash that is expected, if any.
    pub expected_hash: Option<FirmwareHash>,
    /// Its parameters.
    pub parameters: Option<ParameterList>,
    /// When it was left alone.
    pub window: Option<Window>,
    /// The parameter set before a restart.
    pub kept: Option<KeptTrial>,
    /// The multimeter.
    pub calibration: Trial<Calibration>,
    /// The provoked fault.
    pub fault: Trial<FaultTrial>,
    /// The motor steps so far.
    pub motors: Trial<Vec<(MotorStep, StepResult)>>,
}

impl Evidence {
    /// The messages received while the board was left alone; none if that was not reached.
    pub fn in_window(&self) -> impl Iterator<Item = &Received> {
        let is_inside = |received: &&Received| self.window.is_some_and(|window| window.contains(received.at));
        self.record.received.iter().filter(is_inside)
    }

    /// The SYS_STATUS among them.
    pub fn sys_statuses(&self) -> impl Iterator<Item = &SYS_STATUS_DATA> {
        self.in_window().filter_map(|received| match &received.message {
            MavMessage::SYS_STATUS(status) => Some(status),
            _ => None,
        })
    }

    /// The first pack's voltages among them, in volts; none while no pack is connected.
    pub fn voltages_v(&self) -> Vec<f32> {
        self.in_window()
            .filter_map(|received| first_pack_v(&received.message))
            .collect()
    }

    /// A parameter's value in the list.
    pub fn parameter(&self, name: &str) -> Option<f32> {
        self.parameters.as_ref()?.value(name)
    }
}

/// The first pack's voltage in a BATTERY_STATUS, in volts.
pub(super) fn first_pack_v(message: &MavMessage) -> Option<f32> {
    match message {
        MavMessage::BATTERY_STATUS(status) if status.id == 0 => voltage_v(status),
        _ => None,
    }
}

/// The sum of the cells that are known.
fn voltage_v(status: &BATTERY_STATUS_DATA) -> Option<f32> {
    const UNKNOWN_MV: u16 = u16::MAX;
    let known = status.voltages.iter().filter(|mv| **mv != UNKNOWN_MV);
    let sum_mv: u32 = known.chain(&status.voltages_ext).map(|mv| u32::from(*mv)).sum();
    (sum_mv > 0).then_some(sum_mv as f32 / 1e3)
}

/// The mean of some values.
pub(super) fn mean(values: &[f32]) -> Option<f32> {
    (!values.is_empty()).then(|| values.iter().sum::<f32>() / values.len() as f32)
}
