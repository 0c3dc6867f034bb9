//! Messages of the board, each with its time, and evidence of the procedures for the checks.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use rover_battmon::mavlink::dialect::{
    AUTOPILOT_VERSION_DATA, BATTERY_STATUS_DATA, MavMessage, MavResult, MavSeverity, STATUSTEXT_DATA,
    SYS_STATUS_DATA,
};
use rover_battmon::memory::identity::FirmwareHash;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::BatteryParameter;
use rover_battmon::time::Instant;

/// A restart is noticed this long after the board fell silent, at the latest: boot, and the next answer.
const RESTART_NOTICED_US: u64 = 6_000_000;

/// A message of the board.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// When it was received.
    pub at: Instant,
    /// Its content.
    pub message: MavMessage,
}

/// A break between two frames of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// When the frame behind it was received.
    pub at: Instant,
    /// Frames that are missing by the sequence numbers, at most 255.
    pub missing: u8,
    /// Whether bytes came in it that are not part of a frame.
    pub is_damage: bool,
}

/// An answered or unanswered request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RoundTrip {
    /// When it was asked.
    pub asked_at: Instant,
    /// Delay of the answer, in µs; `None` if none came until the next request.
    pub took_us: Option<u64>,
}

/// A start of the board, noticed by its time since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardStart {
    /// When it was noticed.
    pub at: Instant,
    /// Whether it was asked to restart.
    pub is_requested: bool,
}

/// A text of the board.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// When it was complete.
    pub at: Instant,
    /// Its severity.
    pub severity: MavSeverity,
    /// The text.
    pub text: String,
}

/// Messages of the board.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Its messages.
    pub received: Vec<Received>,
    /// System and component ids of other autopilots on the link.
    pub others: BTreeSet<(u8, u8)>,
    /// Breaks in its frames.
    pub gaps: Vec<Gap>,
    /// Its delays of answers.
    pub round_trips: Vec<RoundTrip>,
    /// Its starts.
    pub starts: Vec<BoardStart>,
    /// When the port was lost without a restart that was asked for.
    pub port_losses: Vec<Instant>,
}

impl Recording {
    /// Its texts; those sent in parts are put together.
    pub fn texts(&self) -> Vec<Text> {
        let mut texts: Vec<Text> = Vec::new();
        let mut open_id = 0;
        for received in &self.received {
            let MavMessage::STATUSTEXT(part) = &received.message else {
                continue;
            };
            match texts.last_mut() {
                Some(text) if part.chunk_seq > 0 && part.id == open_id => text.text += part_text(part),
                _ => texts.push(Text {
                    at: received.at,
                    severity: part.severity,
                    text: part_text(part).into(),
                }),
            }
            open_id = part.id;
        }
        texts
    }

    /// The breaks that no start of the board explains.
    pub fn unexplained_gaps(&self) -> impl Iterator<Item = &Gap> {
        self.gaps.iter().filter(|gap| !self.is_broken_by_start(gap.at))
    }

    /// Whether the board may have started just before `at`.
    pub fn is_broken_by_start(&self, at: Instant) -> bool {
        let mut starts = self.starts.iter();
        starts.any(|start| at <= start.at && start.at.us_since(at) < RESTART_NOTICED_US)
    }
}

fn part_text(part: &STATUSTEXT_DATA) -> &str {
    part.text.to_str().unwrap_or_default()
}

/// Why the check ends early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interruption {
    /// The owner stopped it.
    Stopped,
    /// The port was lost and did not come back.
    Lost,
    /// The rover is armed: a check restarts it.
    Armed,
}

/// Result of a restart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Restarted {
    /// The board runs again; how long that took, in µs.
    After(u64),
    /// It was refused.
    Refused(MavResult),
    /// The request was not answered.
    Unanswered,
    /// It was accepted, and the board's time ran on.
    NotSeen,
}

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

/// The board's parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterList {
    /// Their number by the board; `None` if nothing came.
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
    pub found: f32,
    /// Its original value: another one if an earlier check has left the one that was found.
    pub old: f32,
    /// The value it was given.
    pub new: f32,
    /// The board's answer to that.
    pub answered: Option<f32>,
    /// Result of the restart.
    pub restarted: Option<Restarted>,
    /// The value that was read after it.
    pub read: Option<f32>,
    /// The board's answer when the old value was set again.
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

/// The owner's statement about the divider of the pack's voltage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Divider {
    /// Nothing: a factor that is far from the one in force is an error of the multimeter, or in reading it.
    #[default]
    AsBefore,
    /// It is another one now.
    Changed,
}

/// A parameter's value for the board's own divider: the default of the first pack.
pub fn boards_own(parameter: BatteryParameter) -> f32 {
    parameter.of(Pack::First).row().default
}

/// More than parts and the converter's reference are off by, as a share of the factor.
const LARGEST_CHANGE: f32 = 0.15;

/// The shown voltage beside a multimeter's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Calibration {
    /// Reading of the multimeter, in volts; `None` if the owner did not say.
    pub measured_v: Option<f32>,
    /// Report of the board, in volts.
    pub shown_v: Option<f32>,
    /// `BATT_VOLT_MULT` at that time.
    pub old: Option<f32>,
    /// `BATT_VOLT_PIN`.
    pub pin: Option<f32>,
    /// The owner's statement about the divider.
    pub divider: Divider,
    /// The board's answer when the exact value was set; `None` if it was not set.
    pub applied: Option<f32>,
    /// Report of the board since, in volts.
    pub shown_since_v: Option<f32>,
}

impl Calibration {
    /// The value of `BATT_VOLT_MULT` with which the board would show what the multimeter does.
    pub fn exact(&self) -> Option<f32> {
        let shown_v = self.shown_v.filter(|shown_v| *shown_v > 0.0)?;
        Some(self.old? * self.measured_v? / shown_v)
    }

    /// The exact value if it can be believed: near the one in force or near the board's own divider. On another pin than that
    /// one's, nothing is known as long as the factor is the default.
    pub fn believed(&self) -> Option<f32> {
        let exact = self.exact()?;
        let [own_pin, own_factor] = [BatteryParameter::VoltPin, BatteryParameter::VoltMult].map(boards_own);
        let is_near = |factor: f32| (exact - factor).abs() <= LARGEST_CHANGE * factor;
        let fits_pin = if self.pin == Some(own_pin) {
            is_near(own_factor)
        } else {
            self.old == Some(own_factor)
        };
        let is_believed = self.divider == Divider::Changed || fits_pin || self.old.is_some_and(is_near);
        is_believed.then_some(exact)
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

/// Load of the first pack by all motors while it is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Load {
    /// The motors stand.
    None,
    /// A fifth of full throttle.
    Fifth,
    /// Full throttle.
    Full,
}

/// Times in which the pack was measured, with its load.
pub type LoadWindows = Vec<(Load, RangeInclusive<Instant>)>;

/// Everything the checks judge by.
#[derive(Clone, Debug, Default)]
pub struct Evidence {
    /// The messages.
    pub record: Recording,
    /// The board's system and component id; `None` if none was heard.
    pub board: Option<(u8, u8)>,
    /// Why the check ended early.
    pub ended: Option<Interruption>,
    /// Delay of its first heartbeat, in µs.
    pub connected_after_us: u64,
    /// Its version; `None` if it did not answer.
    pub version: Option<AUTOPILOT_VERSION_DATA>,
    /// The firmware's hash that is expected, if any.
    pub expected_hash: Option<FirmwareHash>,
    /// Its parameters.
    pub parameters: Option<ParameterList>,
    /// When it was left alone and listened to.
    pub window: Option<RangeInclusive<Instant>>,
    /// The parameter set before a restart.
    pub kept: Option<KeptTrial>,
    /// The multimeter.
    pub calibration: Trial<Calibration>,
    /// The provoked fault.
    pub fault: Trial<FaultTrial>,
    /// The motor steps so far.
    pub motors: Trial<Vec<(MotorStep, StepResult)>>,
    /// Loads that were measured so far.
    pub loads: Trial<LoadWindows>,
}

impl Evidence {
    /// The messages received while the board was left alone; none if that was not reached.
    pub fn in_window(&self) -> impl Iterator<Item = &Received> {
        let window = self.window.as_ref();
        let is_inside =
            move |received: &&Received| window.is_some_and(|window| window.contains(&received.at));
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

    /// The values that `find` finds while the pack was loaded like this.
    pub fn under_load(
        &self,
        windows: &LoadWindows,
        load: Load,
        find: fn(&MavMessage) -> Option<f32>,
    ) -> Vec<f32> {
        let is_within = |received: &&Received| {
            let mut windows = windows.iter();
            windows.any(|(other, window)| *other == load && window.contains(&received.at))
        };
        let received = self.record.received.iter().filter(is_within);
        received.filter_map(|received| find(&received.message)).collect()
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

/// The first pack's current in a BATTERY_STATUS, in amperes.
pub(super) fn first_pack_a(message: &MavMessage) -> Option<f32> {
    const UNKNOWN: i16 = -1;
    match message {
        MavMessage::BATTERY_STATUS(status) if status.id == 0 && status.current_battery != UNKNOWN => {
            Some(f32::from(status.current_battery) / 1e2)
        }
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
