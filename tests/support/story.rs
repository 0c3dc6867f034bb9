//! Stories: scenarios of packs with their inputs and expected outcomes, one per line of a text file.
//!
//! ```text
//! # a comment
//! param BATT_LOW_VOLT 10.5
//! 5.0 voltage 10.4 current 2     from 5.0 s on
//! 9.0 voltage2 7.9               of pack 2
//! expect 15.1 low                pack 1 is low at 15.1 s
//! expect 15.1 says Battery 1 is low 10.40V
//! end 30
//! ```
//!
//! Inputs: `voltage`, `current`, `voltage2`, `current2` (V, A), `arm`, `disarm`, `reset` (percent, all packs), `fail` and `work`
//! (the sensor of pack 1), `pack` (pack 1 is a simulated one of two cells, with this many mAh, mOhm and percent of charge, until the
//! next `voltage`), its `load` (two currents by turns, four seconds each), `unplug` and `plug`, `loose` and `fixed` (the wire that
//! measures its voltage). Outcomes: `low`, `critical`, `unhealthy` (failsafe level of pack 1), `low2`…, `says` (start of a text, `*`
//! stands for any; `says~2` within two seconds more), `health` (of pack 1, within 3 %, or `unknown`), `charge` (of the simulated
//! pack, is reported within 5 %), and `brake`, `coast` or `turn` (the motors). Every level, and every text about a charge state,
//! charging, a fault, a lost contact, a swap, a restarted estimate or what was learnt has to be expected; motors, health and charge
//! are checked only where expected.
//!
//! Below 2.1 V no pack is connected: `voltage 0.3` is a lost contact.

use std::fs::{self, DirEntry};
use std::io;

use rover_battmon::sensor::AnalogPin;
use rover_battmon::vehicle::MotorDrive;
use rover_battmon_tools::sim::stepped::Converter;
use rover_battmon_tools::sim::{PackModel, SimulatedPack};

use crate::commands::{ARM_DISARM, BATTERY_RESET, REQUEST_MESSAGE};
use crate::desk::DIVIDER;
use crate::frames::{BATTERY_INFO, STATUSTEXT, last_of, of_message};
use crate::repository;
use crate::requests::{VEHICLE_ID, arm_by_force, command_long, command_long_2, manual_control, manual_mode};
use crate::vehicle::TestedVehicle;

/// A parsed story.
#[derive(Default)]
pub struct Story {
    name: String,
    parameters: Vec<(String, f32)>,
    inputs: Vec<(f64, Input)>,
    expectations: Vec<(f64, Outcome)>,
    end_s: f64,
}

/// An input; packs are numbered from 0.
#[derive(Clone, Copy)]
enum Input {
    /// In V.
    Voltage(usize, f32),
    /// In A.
    Current(usize, f32),
    /// With this many mAh, mOhm and percent of charge.
    Pack([f32; 3]),
    Unplug,
    Plug,
    /// Whether the wire that measures the voltage is loose.
    Loose(bool),
    /// In A, by turns.
    Load([f32; 2]),
    Sensor(Converter),
    /// Forced, and in mode MANUAL.
    Arm,
    Disarm,
    /// To this many percent.
    Reset(f32),
}

/// The simulated pack of a story, once there is one.
#[derive(Default)]
struct Source {
    pack: Option<SimulatedPack>,
    is_loose: bool,
    currents_a: [f32; 2],
    loaded_s: f32,
}

impl Source {
    /// Takes an input of the first pack.
    fn take(&mut self, input: Input) {
        match input {
            Input::Pack([capacity_mah, resistance_mohm, charge_pct]) => {
                let ohm = resistance_mohm * 1e-3;
                let model = PackModel {
                    cells: 2,
                    capacity_ah: capacity_mah * 1e-3,
                    ohmic_resistance_ohm: ohm,
                    polarization_resistance_ohm: 0.5 * ohm,
                    ..PackModel::LIPO_3S_2200
                };
                self.pack = Some(SimulatedPack::charged(model, charge_pct / 100.0));
                self.currents_a = [0.0; 2];
            }
            Input::Unplug => self.pack.iter_mut().for_each(SimulatedPack::unplug),
            Input::Plug => self.pack.iter_mut().for_each(SimulatedPack::plug_in),
            Input::Loose(is_loose) => self.is_loose = is_loose,
            Input::Load(currents_a) => {
                self.currents_a = currents_a;
                self.loaded_s = 0.0;
            }
            Input::Voltage(0, _) => self.pack = None,
            _ => {}
        }
    }

    /// State of charge, in percent.
    fn charge_pct(&self) -> Option<f32> {
        Some(self.pack.as_ref()?.charge() * 100.0)
    }

    /// Lets `dt_s` seconds pass: at what voltage and current the simulated pack is measured.
    fn supply(&mut self, dt_s: f32) -> Option<(f32, f32)> {
        let pack = self.pack.as_mut()?;
        let turn = (self.loaded_s / LOAD_TURN_S) as usize % self.currents_a.len();
        self.loaded_s += dt_s;
        pack.draw(self.currents_a[turn], dt_s);
        let volts = if self.is_loose { 0.0 } else { pack.voltage_v() };
        Some((volts, pack.current_a()))
    }
}

/// How long each current of a load lasts, in seconds.
const LOAD_TURN_S: f32 = 4.0;

/// Tolerance of a state of health, in percent.
const HEALTH_TOLERANCE_PCT: u8 = 3;

/// Tolerance of a state of charge, in percent.
const CHARGE_TOLERANCE_PCT: f32 = 5.0;

/// An expected outcome.
#[derive(Clone, Debug, PartialEq)]
enum Outcome {
    /// Of a pack.
    Level(usize, Level),
    /// A text that starts so, and by how many seconds more it may be off: an estimate of one second may cross a limit in the
    /// next.
    Says(String, f64),
    Motors(Drive),
    /// In percent; `None` is unknown.
    Health(Option<u8>),
    /// The state of charge is that of the simulated pack.
    Charge,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Level {
    Unhealthy,
    Low,
    Critical,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Drive {
    Brake,
    Coast,
    Turn,
}

/// Texts about a pack, after "Battery 1 ", each of which has to be expected.
const TEXTS_TO_EXPECT: [&str; 11] = [
    "not connected",
    "connected again",
    "swapped",
    "estimate restarted",
    "low:",
    "critical:",
    "emergency:",
    "charging",
    "fault:",
    "learnt:",
    "percentages",
];

/// The failsafe level that a text announces, and its pack.
fn level_of(text: &str) -> Option<(usize, Level)> {
    let rest = text.strip_prefix("Battery ")?;
    let (number, rest) = rest.split_once(" is ")?;
    let level = match rest.split_whitespace().next()? {
        "missing," => Level::Unhealthy,
        "low" => Level::Low,
        "critical" => Level::Critical,
        _ => return None,
    };
    Some((number.parse::<usize>().ok()? - 1, level))
}

impl Story {
    /// Parses the stories in `tests/stories/`.
    pub fn all() -> Vec<Self> {
        let folder = repository().join("tests/stories");
        let parse = |entry: io::Result<DirEntry>| {
            let path = entry.expect("readable").path();
            let name = path.file_stem().and_then(|stem| stem.to_str()).expect("a name");
            Self::parse(name, &fs::read_to_string(&path).expect("readable"))
        };
        let entries = fs::read_dir(folder).expect("the folder exists");
        let stories: Vec<_> = entries.map(parse).collect();
        assert!(!stories.is_empty(), "no story was found");
        stories
    }

    /// The story of this name.
    pub fn named(name: &str) -> Self {
        let mut stories = Self::all().into_iter();
        let story = stories.find(|story| story.name == name);
        story.unwrap_or_else(|| panic!("no story {name}"))
    }

    /// Asserts a state of charge, in percent.
    fn check_charge(&self, at_s: f64, reported_pct: Option<f32>, true_pct: Option<f32>) {
        let is_right = |(reported, expected): (f32, f32)| (reported - expected).abs() <= CHARGE_TOLERANCE_PCT;
        assert!(
            reported_pct.zip(true_pct).is_some_and(is_right),
            "{}: {reported_pct:?} % at {at_s} s, of {true_pct:?} %",
            self.name
        );
    }

    /// Asserts a state of health.
    fn check_health(&self, at_s: f64, found_pct: Option<u8>, expected_pct: Option<u8>) {
        let is_expected = match (found_pct, expected_pct) {
            (Some(found), Some(expected)) => found.abs_diff(expected) <= HEALTH_TOLERANCE_PCT,
            (found, expected) => found == expected,
        };
        assert!(is_expected, "{}: health {found_pct:?} at {at_s} s", self.name);
    }

    /// Asserts that these texts were sent, each with its time, and no level or text that has to be expected beside them.
    fn check_texts(&self, texts: &[(f64, String)], tolerance_s: f64) {
        let name = &self.name;
        eprintln!("TEXTS {name} {texts:?}");
        let mut levels: Vec<_> = texts
            .iter()
            .filter_map(|(time_s, text)| Some((*time_s, level_of(text)?)))
            .collect();
        for (at_s, outcome) in &self.expectations {
            match outcome {
                Outcome::Level(pack, level) => {
                    let found = levels.iter().position(|(time_s, what)| {
                        is_about(*time_s, *at_s, tolerance_s) && *what == (*pack, *level)
                    });
                    let found =
                        found.unwrap_or_else(|| panic!("{name}: no {level:?} at {at_s} s: {texts:?}"));
                    levels.remove(found);
                }
                Outcome::Says(start, slack_s) => assert!(
                    texts.iter().any(|(time_s, text)| {
                        is_about(*time_s, *at_s, tolerance_s + slack_s) && starts_so(text, start)
                    }),
                    "{name}: no text {start:?} at {at_s} s: {texts:?}"
                ),
                Outcome::Motors(_) | Outcome::Health(_) | Outcome::Charge => {}
            }
        }
        assert_eq!(levels, [], "{name}: not expected");
        let unexpected = self.unexpected(texts, tolerance_s);
        assert!(unexpected.is_empty(), "{name}: not expected: {unexpected:?}");
    }

    /// Texts that have to be expected, and are not.
    fn unexpected<'a>(&self, texts: &'a [(f64, String)], tolerance_s: f64) -> Vec<&'a (f64, String)> {
        let has_to_be_expected = |text: &str| {
            let what = text.split_once(' ').and_then(|(_, rest)| rest.split_once(' '));
            what.is_some_and(|(_, what)| TEXTS_TO_EXPECT.iter().any(|known| what.starts_with(known)))
        };
        let is_expected = |time_s: f64, text: &str| {
            self.expectations.iter().any(|(at_s, outcome)| {
                matches!(outcome, Outcome::Says(start, slack_s) if starts_so(text, start)
                    && is_about(time_s, *at_s, tolerance_s + slack_s))
            })
        };
        let texts = texts.iter();
        texts
            .filter(|(time_s, text)| has_to_be_expected(text) && !is_expected(*time_s, text))
            .collect()
    }

    /// Parses a story.
    ///
    /// # Panics
    /// On a syntax error, with its line.
    fn parse(name: &str, text: &str) -> Self {
        let mut story = Self {
            name: name.into(),
            ..Self::default()
        };
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.split('#').next().unwrap_or_default().trim();
            if !line.is_empty() && story.parse_line(line).is_none() {
                panic!("{name}, line {number}: {line:?} is not valid");
            }
        }
        assert!(story.end_s > 0.0, "{name}: no end");
        story
    }

    fn parse_line(&mut self, line: &str) -> Option<()> {
        let mut words = line.split_whitespace();
        match words.next()? {
            "param" => self
                .parameters
                .push((words.next()?.into(), words.next()?.parse().ok()?)),
            "end" => self.end_s = words.next()?.parse().ok()?,
            "expect" => {
                let at_s = words.next()?.parse().ok()?;
                let rest: Vec<_> = words.collect();
                self.expectations.push((at_s, outcome(&rest)?));
            }
            time => {
                let at_s = time.parse().ok()?;
                while let Some(word) = words.next() {
                    self.inputs.push((at_s, input(word, &mut words)?));
                }
            }
        }
        Some(())
    }
}

/// An asterisk stands for any text.
fn starts_so(text: &str, start: &str) -> bool {
    match start.split_once('*') {
        Some((start, later)) => text.starts_with(start) && text.contains(later),
        None => text.starts_with(start),
    }
}

fn is_about(time_s: f64, at_s: f64, tolerance_s: f64) -> bool {
    (time_s - at_s).abs() <= tolerance_s
}

fn input<'a>(word: &str, words: &mut impl Iterator<Item = &'a str>) -> Option<Input> {
    let (word, pack) = match word.strip_suffix('2') {
        Some(word) => (word, 1),
        None => (word, 0),
    };
    let mut number = || words.next()?.parse().ok();
    Some(match word {
        "voltage" => Input::Voltage(pack, number()?),
        "current" => Input::Current(pack, number()?),
        "pack" => Input::Pack([number()?, number()?, number()?]),
        "unplug" => Input::Unplug,
        "plug" => Input::Plug,
        "loose" => Input::Loose(true),
        "fixed" => Input::Loose(false),
        "load" => Input::Load([number()?, number()?]),
        "reset" => Input::Reset(number()?),
        "arm" => Input::Arm,
        "disarm" => Input::Disarm,
        "fail" => Input::Sensor(Converter::Stalled),
        "work" => Input::Sensor(Converter::Working),
        _ => return None,
    })
}

fn outcome(words: &[&str]) -> Option<Outcome> {
    Some(match words {
        ["low"] => Outcome::Level(0, Level::Low),
        ["low2"] => Outcome::Level(1, Level::Low),
        ["critical"] => Outcome::Level(0, Level::Critical),
        ["critical2"] => Outcome::Level(1, Level::Critical),
        ["unhealthy"] => Outcome::Level(0, Level::Unhealthy),
        ["unhealthy2"] => Outcome::Level(1, Level::Unhealthy),
        ["brake"] => Outcome::Motors(Drive::Brake),
        ["coast"] => Outcome::Motors(Drive::Coast),
        ["turn"] => Outcome::Motors(Drive::Turn),
        ["charge"] => Outcome::Charge,
        ["health", "unknown"] => Outcome::Health(None),
        ["health", percent] => Outcome::Health(Some(percent.parse().ok()?)),
        [says, text @ ..] if !text.is_empty() => {
            let slack_s = match says.strip_prefix("says")? {
                "" => 0.0,
                slack => slack.strip_prefix('~')?.parse().ok()?,
            };
            Outcome::Says(text.join(" "), slack_s)
        }
        _ => return None,
    })
}

/// Dividers of both packs, and the first one's current sensor.
const DIVIDERS: [AnalogPin; 2] = [AnalogPin::Gp26, AnalogPin::Gp28];
const CURRENT_SENSOR: AnalogPin = AnalogPin::Gp27;

const AMPERES_PER_VOLT: f32 = 17.0;

/// Half throttle, so that the motors turn when allowed.
const THROTTLE: i16 = 500;

/// Interval of the stick input.
const STEP_US: u64 = 100_000;

/// Up to a tick until it is measured, and until a text has left behind other messages; a count more of the current is
/// earlier by as much.
const LATENCY_S: f64 = 0.25;

/// A vehicle that plays a story, from voltages at its pins and frames to texts and motors.
struct Stage<V> {
    vehicle: V,
    start_us: u64,
    source: Source,
}

impl<V: TestedVehicle> Stage<V> {
    /// A vehicle with the story's parameters, and no pack yet: its story begins when it is plugged in.
    fn new(story: &Story) -> Self {
        let mut parameters = vec![("BATT_MONITOR", 4.0), ("BATT_CURR_PIN", 27.0)];
        let of_story = story.parameters.iter();
        parameters.extend(of_story.map(|(name, value)| (name.as_str(), *value)));
        let vehicle = V::configured(&parameters);
        Self {
            start_us: vehicle.time_us(),
            vehicle,
            source: Source::default(),
        }
    }

    fn time_s(&self) -> f64 {
        (self.vehicle.time_us() - self.start_us) as f64 * 1e-6
    }

    fn take(&mut self, input: Input) {
        self.source.take(input);
        match input {
            Input::Voltage(pack, volts) => self.vehicle.set_pin_v(DIVIDERS[pack], volts / DIVIDER),
            Input::Current(pack, amperes) => {
                assert_eq!(pack, 0, "only the first pack has a current sensor");
                self.vehicle.set_pin_v(CURRENT_SENSOR, amperes / AMPERES_PER_VOLT);
            }
            Input::Sensor(converter) => self.vehicle.set_converter(converter),
            Input::Arm => {
                // A stick deflected on arming would have to be neutral first. A mode that is set afterwards could end the HOLD
                // of a failsafe that armed packs reach at once.
                let frames = [manual_control(VEHICLE_ID, 0, 0), manual_mode(), arm_by_force()];
                self.vehicle.send(&frames.concat());
            }
            Input::Disarm => self.vehicle.send(&command_long_2(ARM_DISARM, 0.0, 0.0)),
            Input::Reset(percent) => self
                .vehicle
                .send(&command_long_2(BATTERY_RESET, 65535.0, percent)),
            Input::Pack(_) | Input::Unplug | Input::Plug | Input::Loose(_) | Input::Load(_) => {}
        }
    }

    fn step(&mut self) {
        if let Some((volts, amperes)) = self.source.supply(STEP_US as f32 * 1e-6) {
            self.vehicle.set_pin_v(DIVIDERS[0], volts / DIVIDER);
            self.vehicle.set_pin_v(CURRENT_SENSOR, amperes / AMPERES_PER_VOLT);
        }
        self.vehicle.send(&manual_control(VEHICLE_ID, 0, THROTTLE));
        self.vehicle.run_for(STEP_US);
    }

    /// The motors on the left.
    fn motors(&self) -> Drive {
        match self.vehicle.left_drive() {
            MotorDrive::Coast => Drive::Coast,
            MotorDrive::Brake => Drive::Brake,
            MotorDrive::Turn(_) => Drive::Turn,
        }
    }

    /// The first pack's state of health, in percent, by BATTERY_INFO.
    fn health_pct(&mut self) -> Option<u8> {
        const UNKNOWN_PCT: u8 = 255;
        let request = command_long(REQUEST_MESSAGE, BATTERY_INFO as f32);
        let answers = self.vehicle.ask(&request);
        let info = of_message(&answers, BATTERY_INFO)[0];
        Some(info.u8(47)).filter(|percent| *percent != UNKNOWN_PCT)
    }

    /// The first pack's state of charge, in percent, by the latest BATTERY_STATUS.
    fn reported_pct(&mut self) -> Option<f32> {
        let frames = self.vehicle.frames_since(self.start_us);
        let percent = last_of(&frames, 0).remaining_pct();
        (percent >= 0).then_some(f32::from(percent))
    }

    /// Checks what is due of these expectations.
    fn check_due(&mut self, story: &Story, due: &mut Vec<(f64, Outcome)>) {
        let now_s = self.time_s();
        for (at_s, outcome) in due.extract_if(.., |(at_s, _)| *at_s + LATENCY_S <= now_s) {
            match outcome {
                Outcome::Motors(drive) => assert_eq!(self.motors(), drive, "{} at {at_s} s", story.name),
                Outcome::Health(percent) => story.check_health(at_s, self.health_pct(), percent),
                Outcome::Charge => {
                    story.check_charge(at_s, self.reported_pct(), self.source.charge_pct());
                }
                Outcome::Level(..) | Outcome::Says(..) => {}
            }
        }
    }

    /// The texts since the start, with the time at which they had left.
    fn texts(&mut self) -> Vec<(f64, String)> {
        let start_us = self.start_us;
        let frames = self.vehicle.frames_since(start_us);
        let texts = of_message(&frames, STATUSTEXT).into_iter();
        texts
            .map(|frame| ((frame.at_us - start_us) as f64 * 1e-6, frame.text(1, 50)))
            .collect()
    }
}

/// Plays a story on a vehicle.
///
/// # Panics
/// An outcome is not the expected one.
pub fn play<V: TestedVehicle>(story: &Story) {
    let mut stage = Stage::<V>::new(story);
    let mut inputs = story.inputs.iter().peekable();
    let mut due = story.expectations.clone();
    while stage.time_s() < story.end_s {
        let now_s = stage.time_s();
        while let Some((_, input)) = inputs.next_if(|(at_s, _)| *at_s <= now_s + 1e-6) {
            stage.take(*input);
        }
        stage.check_due(story, &mut due);
        stage.step();
    }
    let is_of_text = |outcome: &Outcome| matches!(outcome, Outcome::Level(..) | Outcome::Says(..));
    let unchecked = due.iter().find(|(_, outcome)| !is_of_text(outcome));
    assert_eq!(unchecked, None, "{} ends too soon", story.name);
    story.check_texts(&stage.texts(), LATENCY_S);
}
