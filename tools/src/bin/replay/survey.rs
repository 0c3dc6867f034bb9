//! Facts of a log as a whole: parameters, rover, packs and time.

use std::fmt;
use std::io;

use rover_battmon::autopilot::Notice;
use rover_battmon::battery::{FailsafeTimer, LEARNT_CURVE, LEARNT_WORDS, LearntPack};
use rover_battmon::pack::{MAX_PACKS, Pack};
use rover_battmon::parameter::{ParameterId, Parameters};
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::recordings::entry::{Bytes, CURVE_WORDS, Content, Entries, Entry};

use crate::assignments::LogParameters;
use crate::failsafes::{Levels, Reached, Timers, announced};
use crate::vehicle::Vehicle;
use crate::words::{clock, duration, times};

/// Parameters with the system id: that of ArduPilot up to 4.6, and the later one.
const SYSTEM_ID: [&str; 2] = ["SYSID_THISMAV", "MAV_SYSID"];

/// ArduPilot's parameter by which a log begins with arming.
const LOG_DISARMED: &str = "LOG_DISARMED";
const FROM_ARMING: f64 = 0.0;

/// The beginning of the board's text about a crash.
const CRASH: &str = "Crash";

/// The measurement, or what the monitor is given of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// The voltage.
    pub voltage: bool,
    /// The current.
    pub current: bool,
}

/// Facts of a log as a whole; `None` if it lacks one.
#[derive(Debug, Default)]
pub struct Survey {
    /// The first value of each parameter, defaults beside.
    pub parameters: Option<Parameters>,
    /// Which vehicle recorded it.
    pub vehicle: Vehicle,
    /// Other vehicles in it, whose packs are not read, with their readings.
    pub other_systems: Vec<(u8, u64)>,
    /// Readings come from SYS_STATUS.
    pub is_from_sys_status: bool,
    /// The first step of the recorder's clock and its time, in seconds, and how many there are.
    pub clock_steps: Option<(f64, f64, usize)>,
    /// MAVLink's id of the rover.
    pub system_id: Option<i32>,
    /// The board's serial number.
    pub board_id: Option<String>,
    /// The end of the run before it, if its driver did not end it.
    pub run_before: Option<String>,
    /// When the recorder started, in seconds since 1970 (UTC).
    pub started_utc_s: Option<f64>,
    /// Measured quantities of each pack that has a reading.
    packs: [Option<Inputs>; MAX_PACKS],
    learnt: [Option<[u32; LEARNT_WORDS]>; MAX_PACKS],
    known_parameters: LogParameters,
    first_arming: Option<ArmState>,
    log_disarmed: Option<f64>,
    /// Its failsafes of each pack, in seconds since the recorder started.
    reached: [Reached; MAX_PACKS],
    timers: [Timers; MAX_PACKS],
    /// The first one of any pack and level, and the first mode for one.
    any_failsafe_s: Option<f64>,
    failsafe_mode_s: Option<f64>,
    has_flown: bool,
    has_texts: bool,
    reports_arm_state: bool,
    /// The board recorded estimates without extremes of single conversions.
    lacks_extremes: bool,
    /// Readings that were skipped, since their times step back.
    pub stepped_back: u64,
    /// Its bytes, readable or not.
    pub bytes: Bytes,
}

/// Why a log begins armed, though it does not have the arming.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmedBefore {
    /// Its first entry of arming is a disarming.
    FirstIsDisarming,
    /// It is recorded while armed only.
    RecordedWhileArmed,
    /// It has events that occur in flight only.
    Airborne,
}

impl fmt::Display for ArmedBefore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FirstIsDisarming => "the log has the disarming only",
            Self::RecordedWhileArmed => "LOG_DISARMED is 0",
            Self::Airborne => "the log has events of a flight",
        })
    }
}

impl Survey {
    /// Reads a log to its end.
    pub fn of(mut entries: Box<dyn Entries + '_>) -> io::Result<Self> {
        let mut survey = Self::default();
        for entry in entries.by_ref() {
            survey.take(&entry?);
        }
        survey.bytes = entries.bytes();
        Ok(survey)
    }

    /// Why there is nothing to replay; `None` if there is.
    pub fn obstacle(&self) -> Option<&'static str> {
        let has_reading = self.packs.iter().any(Option::is_some);
        (!has_reading).then_some("no reading of a pack")
    }

    /// Measured quantities of a pack; `None` without a reading.
    pub fn measured(&self, pack: Pack) -> Option<Inputs> {
        self.packs[usize::from(pack.instance())]
    }

    /// Knowledge of a pack at the beginning of the file.
    pub fn known(&self, pack: Pack) -> Option<LearntPack> {
        LearntPack::from_words(self.learnt[usize::from(pack.instance())].as_ref()?)
    }

    /// Why the vehicle is armed at the beginning of the file, if it is.
    pub fn armed_before(&self) -> Option<ArmedBefore> {
        match self.first_arming {
            _ if self.reports_arm_state => None,
            Some(ArmState::Armed) => None,
            Some(ArmState::Disarmed) => Some(ArmedBefore::FirstIsDisarming),
            None if self.log_disarmed == Some(FROM_ARMING) => Some(ArmedBefore::RecordedWhileArmed),
            None => self.has_flown.then_some(ArmedBefore::Airborne),
        }
    }

    /// When the log has a pack reach the levels of its failsafe.
    pub fn recorded_levels(&self, pack: Pack) -> Levels {
        self.reached(pack).levels()
    }

    /// Each time the log has a pack reach a level of its failsafe.
    pub fn reached(&self, pack: Pack) -> &Reached {
        &self.reached[usize::from(pack.instance())]
    }

    /// Whether the log has the failsafe of a pack as this firmware has run it, to the tick.
    pub fn records_failsafe(&self, pack: Pack) -> bool {
        self.vehicle.is_of_this_firmware() || *self.recorded_timers(pack) != Timers::default()
    }

    /// The timers of a pack's failsafe in the log.
    pub fn recorded_timers(&self, pack: Pack) -> &Timers {
        &self.timers[usize::from(pack.instance())]
    }

    /// When the failsafe of a pack acted in a log that does not say which one.
    pub fn unnamed_failsafe_s(&self) -> Option<f64> {
        let is_named = self
            .reached
            .iter()
            .any(|reached| reached.levels() != Levels::default());
        self.any_failsafe_s.filter(|_| !is_named)
    }

    /// When the vehicle took another mode for the failsafe of a pack.
    pub fn failsafe_mode_s(&self) -> Option<f64> {
        self.failsafe_mode_s
    }

    /// Whether the failsafe of a pack has a text in the log.
    pub fn announces_failsafes(&self) -> bool {
        self.has_texts && self.vehicle.announces_failsafes()
    }

    /// Whether the log has a value of a parameter.
    pub fn has_parameter(&self, id: ParameterId) -> bool {
        self.known_parameters.has(&id.name())
    }

    /// Whether the board read the analog pins of a pack for a moment in each tick, as versions did that record no extremes of
    /// single conversions.
    pub fn is_of_moments(&self, pack: Pack) -> bool {
        let parameters = self.parameters.as_ref();
        let kind = parameters.and_then(|parameters| parameters.monitor_kind(pack));
        self.lacks_extremes && kind.is_some_and(|kind| kind.reads_voltage_pin() || kind.reads_current_pin())
    }

    /// The first step of the recorder's clock, and their number: `clock stepped back by 2 h at 0:10 (once)`.
    pub fn clock_text(&self) -> Option<String> {
        let (step_s, time_s, count) = self.clock_steps?;
        let direction = if step_s < 0.0 { "back" } else { "ahead" };
        let (step, time) = (duration(step_s.abs()), clock(time_s));
        Some(format!(
            "clock stepped {direction} by {step} at {time} ({})",
            times(count)
        ))
    }

    /// Whether the vehicle is armed at the beginning of the file.
    pub fn initial_arm_state(&self) -> ArmState {
        match self.armed_before() {
            Some(_) => ArmState::Armed,
            None => ArmState::Disarmed,
        }
    }

    fn take(&mut self, entry: &Entry) {
        self.vehicle.take(&entry.content);
        match &entry.content {
            Content::Parameter(name, value) => self.parameter(name, *value),
            Content::Board(id) => self.board_id = Some(id.clone()),
            Content::Reading(pack, sample) => self.reading(*pack, sample.current_a),
            Content::Estimate(_, estimate) => self.lacks_extremes |= estimate.extremes.is_none(),
            Content::StartUtc(utc_s) => {
                self.started_utc_s.get_or_insert(*utc_s);
            }
            Content::Learnt(pack, _, words) => self.learnt(*pack, words),
            Content::Curve(pack, words) => self.curve(*pack, words),
            Content::Arming(state) => {
                self.first_arming.get_or_insert(*state);
            }
            Content::Text(text) => {
                self.has_texts = true;
                self.announcement(text, entry.time_s);
            }
            Content::PackFailsafe => self.any_failsafe_s = self.any_failsafe_s.or(entry.time_s),
            Content::FailsafeMode => self.failsafe_mode_s = self.failsafe_mode_s.or(entry.time_s),
            Content::FailsafeTimer(pack, change) => {
                let time_s = entry.time_s.unwrap_or_default();
                let place = usize::from(pack.instance());
                self.timers[place].add(time_s, *change);
                if let (level, FailsafeTimer::Expired) = *change {
                    self.reached[place].add(level, time_s);
                }
            }
            Content::Airborne => self.has_flown = true,
            Content::ArmState(_) => self.reports_arm_state = true,
            Content::SystemId(id) => {
                self.system_id.get_or_insert(*id);
                // A ground station hears it all along.
                self.reports_arm_state = true;
            }
            Content::OtherSystem(id, readings) => self.other_systems.push((*id, *readings)),
            Content::SteppedBack => self.stepped_back += 1,
            Content::FromSysStatus => self.is_from_sys_status = true,
            Content::ClockStep(step_s) => {
                let first = (*step_s, entry.time_s.unwrap_or_default(), 0);
                self.clock_steps.get_or_insert(first).2 += 1;
            }
            _ => {}
        }
    }

    /// The first value of each holds from the beginning of the file: at the start they are written between readings.
    fn parameter(&mut self, name: &str, value: f64) {
        if SYSTEM_ID.contains(&name) {
            self.system_id.get_or_insert(value as i32);
        }
        if name == LOG_DISARMED {
            self.log_disarmed.get_or_insert(value);
        }
        if let Some((id, value)) = self.known_parameters.first_value(name, value) {
            let parameters = self.parameters.get_or_insert_with(Parameters::defaults);
            // A value that is out of range in this version does not matter.
            let _ = parameters.set(id, value);
        }
    }

    fn reading(&mut self, pack: Pack, current_a: Option<f32>) {
        let measured = &mut self.packs[usize::from(pack.instance())];
        let had_current = measured.is_some_and(|measured| measured.current);
        *measured = Some(Inputs {
            voltage: true,
            current: had_current || current_a.is_some(),
        });
    }

    fn announcement(&mut self, text: &str, time_s: Option<f64>) {
        if let Some(((pack, level), time_s)) = announced(text).zip(time_s) {
            self.reached[usize::from(pack.instance())].add(level, time_s);
        }
        if self.run_before.is_none() && is_about_run_before(text) {
            self.run_before = Some(text.into());
        }
    }

    /// The first record of a pack is what was known at the beginning.
    fn learnt(&mut self, pack: Pack, words: &[u32; LEARNT_WORDS]) {
        self.learnt[usize::from(pack.instance())].get_or_insert(*words);
    }

    fn curve(&mut self, pack: Pack, words: &[u32; CURVE_WORDS]) {
        if let Some(learnt) = &mut self.learnt[usize::from(pack.instance())] {
            learnt[LEARNT_CURVE].copy_from_slice(words);
        }
    }
}

fn is_about_run_before(text: &str) -> bool {
    let interruptions = [Notice::PowerWentOff, Notice::ResetWhileArmed];
    text.starts_with(CRASH) || interruptions.iter().any(|notice| text == notice.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_the_run_before_is_the_first_text_about_it() {
        let mut survey = Survey::default();
        for text in [
            "rover-battmon 0.1.0",
            "Power went off while armed",
            "Battery 1 is low",
            "Crash: drive was overdue",
        ] {
            survey.announcement(text, None);
        }
        assert_eq!(survey.run_before.as_deref(), Some("Power went off while armed"));
    }

    #[test]
    fn a_curve_belongs_to_the_pack_before_it() {
        let known: LearntPack = "chemistry 3\ncells 1\ncapacity_mah_sigma 2987.5 0.03\n\
                                 offsets_100uv_sigma 75 144 -201 144 -323 144 -428 144 236 144\n\
                                 slow_share_sigma 0.4 0.06\n"
            .parse()
            .expect("a pack");
        let words = known.to_words();
        let mut pack = words;
        pack[LEARNT_CURVE].fill(0);
        let mut survey = Survey::default();
        survey.learnt(Pack::First, &pack);
        survey.curve(Pack::First, words[LEARNT_CURVE].try_into().expect("its length"));
        assert_eq!(survey.known(Pack::First), Some(known));
    }

    #[test]
    fn a_log_begins_armed_by_its_first_arming_else_by_its_own_parameter_or_events() {
        let arming = Content::Arming;
        let recorded = |value| Content::Parameter("LOG_DISARMED".into(), value);
        let (armed, disarmed) = (arming(ArmState::Armed), arming(ArmState::Disarmed));
        for (contents, expected) in [
            (vec![disarmed, armed.clone()], Some(ArmedBefore::FirstIsDisarming)),
            (vec![recorded(0.0), armed], None),
            (vec![recorded(0.0)], Some(ArmedBefore::RecordedWhileArmed)),
            (vec![recorded(1.0), recorded(0.0)], None),
            (vec![Content::Airborne], Some(ArmedBefore::Airborne)),
            (
                vec![recorded(1.0), Content::Airborne],
                Some(ArmedBefore::Airborne),
            ),
            // Of a ground station's log, which hears it all along.
            (vec![Content::SystemId(1), recorded(0.0)], None),
            (vec![], None),
        ] {
            let mut survey = Survey::default();
            for content in contents {
                survey.take(&Entry {
                    time_s: None,
                    content,
                });
            }
            assert_eq!(survey.armed_before(), expected);
        }
    }
}
