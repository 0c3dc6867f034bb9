//! Stories, run on the core: monitors and vehicle without tasks, links or a clock.

#[path = "support/story.rs"]
mod story;

use std::fs;
use std::path::Path;

use rover_battmon::battery::{
    ArmState, BatteryBank, FailsafeLevel, Measurement, PackEvent, PackSettings, ReadError, Tick,
};
use rover_battmon::mavlink::pack_announcement;
use rover_battmon::parameter::{Pack, ParameterId, Parameters};
use rover_battmon::vehicle::{FailsafeAction, Mode, MotorDrive, StickInput, Vehicle, VehicleSettings};
use story::{Drive, Input, Level, Outcome, Story};

const TICK_US: u64 = 100_000;

/// One tick after the cause, and another for rounding.
const TOLERANCE_S: f64 = 0.2;

/// Half throttle, so that the motors turn when allowed.
const THROTTLE: i16 = 500;

/// A rover that runs a story.
struct Stage {
    parameters: Parameters,
    bank: BatteryBank,
    vehicle: Vehicle,
    /// Voltage and current of the first two packs.
    sensed: [Measurement; 2],
    sensor_fails: bool,
    levels: Vec<(f64, usize, Level)>,
    texts: Vec<(f64, String)>,
    drives: Vec<(f64, Drive)>,
}

impl Stage {
    fn new(story: &Story) -> Self {
        let mut parameters = Parameters::defaults();
        let measured = [
            ("BATT_MONITOR".to_string(), 4.0),
            ("BATT_CURR_PIN".to_string(), 27.0),
        ];
        for (name, value) in measured.iter().chain(&story.parameters) {
            let id = ParameterId::from_name(name.as_bytes()).unwrap_or_else(|| panic!("no {name}"));
            assert_eq!(parameters.set(id, *value), Ok(()), "{name} {value}");
        }
        Self {
            parameters,
            bank: BatteryBank::new(),
            vehicle: Vehicle::new(),
            sensed: [Measurement::default(); 2],
            sensor_fails: false,
            levels: Vec::new(),
            texts: Vec::new(),
            drives: Vec::new(),
        }
    }

    fn take(&mut self, now_us: u64, input: Input) {
        match input {
            Input::Voltage { pack, volts } => self.sensed[pack].voltage_v = Some(volts),
            Input::Current { pack, amperes } => self.sensed[pack].current_a = Some(amperes),
            Input::Arm => {
                let _ = self.vehicle.arm(now_us, true);
                let _ = self.vehicle.set_mode(Mode::Manual);
            }
            Input::Disarm => self.vehicle.disarm(),
            Input::SensorFails => self.sensor_fails = true,
            Input::SensorWorks => self.sensor_fails = false,
            Input::Reset { percent } => {
                for pack in Pack::ALL {
                    let settings = PackSettings::from_parameters(&self.parameters, pack);
                    self.bank.monitor(pack).reset(percent, &settings);
                }
            }
        }
    }

    fn tick(&mut self, now_us: u64) {
        let time_s = now_us as f64 * 1e-6;
        // A stick deflected on arming would have to be neutral first.
        let throttle = match self.vehicle.arm_state() {
            ArmState::Armed => THROTTLE,
            ArmState::Disarmed => 0,
        };
        self.vehicle
            .control(now_us, StickInput::Position(throttle), StickInput::Position(0));
        for (number, pack) in Pack::ALL.into_iter().enumerate().take(self.sensed.len()) {
            if self.sensed[number].voltage_v.is_some() {
                self.tick_pack(now_us, number, pack);
            }
        }
        self.vehicle.update_batteries(self.bank.worst_failsafe());
        let settings = VehicleSettings::from_parameters(&self.parameters);
        self.vehicle.update(now_us, &settings);
        self.drives.push((time_s, drive(self.vehicle.drives().left)));
    }

    fn tick_pack(&mut self, now_us: u64, number: usize, pack: Pack) {
        let time_s = now_us as f64 * 1e-6;
        let reading = if number == 0 && self.sensor_fails {
            Err(ReadError::Timeout)
        } else {
            Ok(self.sensed[number])
        };
        let settings = PackSettings::from_parameters(&self.parameters, pack);
        let tick = Tick {
            now_us,
            arm_state: self.vehicle.arm_state(),
        };
        let (events, _) = self.bank.monitor(pack).update(tick, reading, &settings);
        for event in events {
            self.texts
                .push((time_s, pack_announcement(pack, &event).1.to_string()));
            if let PackEvent::Failsafe { level, .. } = event {
                self.levels.push((time_s, number, level_of(level)));
                let action = FailsafeAction::from_parameters(&self.parameters, pack, level);
                self.vehicle.battery_failsafe(action);
            }
        }
    }

    fn check(&self, story: &Story) {
        let name = &story.name;
        let mut levels = self.levels.clone();
        for (at_s, outcome) in &story.expectations {
            let is_then = |time_s: f64| (time_s - at_s).abs() <= TOLERANCE_S;
            match outcome {
                Outcome::Level { pack, level } => {
                    let found = levels
                        .iter()
                        .position(|(time_s, who, what)| is_then(*time_s) && who == pack && what == level);
                    let found = found
                        .unwrap_or_else(|| panic!("{name}: no {level:?} at {at_s} s: {:?}", self.levels));
                    levels.remove(found);
                }
                Outcome::Says(text) => assert!(
                    self.texts
                        .iter()
                        .any(|(time_s, said)| is_then(*time_s) && said.starts_with(text)),
                    "{name}: no text {text:?} at {at_s} s: {:?}",
                    self.texts
                ),
                Outcome::Motors(expected) => {
                    let then = self
                        .drives
                        .iter()
                        .rfind(|(time_s, _)| time_s <= at_s)
                        .expect("a tick");
                    assert_eq!(then.1, *expected, "{name} at {at_s} s");
                }
            }
        }
        assert_eq!(levels, [], "{name}: not expected");
        let unexpected = story.unexpected(&self.texts, TOLERANCE_S);
        assert!(unexpected.is_empty(), "{name}: not expected: {unexpected:?}");
    }
}

fn level_of(level: FailsafeLevel) -> Level {
    match level {
        FailsafeLevel::None => panic!("no level to announce"),
        FailsafeLevel::Unhealthy => Level::Unhealthy,
        FailsafeLevel::Low => Level::Low,
        FailsafeLevel::Critical => Level::Critical,
    }
}

fn drive(drive: MotorDrive) -> Drive {
    match drive {
        MotorDrive::Coast => Drive::Coast,
        MotorDrive::Brake => Drive::Brake,
        MotorDrive::Turn(_) => Drive::Turn,
    }
}

fn run(story: &Story) {
    let mut stage = Stage::new(story);
    let mut inputs = story.inputs.iter().peekable();
    for tick in 0..=(story.end_s * 10.0) as u64 {
        let now_us = tick * TICK_US;
        while let Some((_, input)) = inputs.next_if(|(at_s, _)| at_s * 1e6 <= now_us as f64 + 1.0) {
            stage.take(now_us, *input);
        }
        stage.tick(now_us);
    }
    stage.check(story);
}

#[test]
fn every_story_has_its_expected_outcomes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/stories");
    let mut stories = 0;
    for entry in fs::read_dir(folder).expect("the folder exists") {
        let path = entry.expect("readable").path();
        let name = path.file_stem().and_then(|stem| stem.to_str()).expect("a name");
        let text = fs::read_to_string(&path).expect("readable");
        run(&Story::parse(name, &text));
        stories += 1;
    }
    assert!(stories > 0, "no story was found");
}
