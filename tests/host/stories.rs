//! Stories, run on the core: voltages at its pins and frames in, texts and motor outputs out.

use rover_battmon::autopilot::{FlashStore, Start};
use rover_battmon::battery::ReadError;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{ParameterId, Parameters};
use rover_battmon::sensor::{AdcCount, AnalogPin, AnalogReadings};
use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::MotorDrive;
use support::desk::{DIVIDER, Desk, adc_count};
use support::frames::{Frame, STATUSTEXT};
use support::requests::{VEHICLE_ID, manual_control};
use support::story::{Drive, Input, Source, Story, Supplied};

/// Dividers of both packs, and the first one's current sensor.
const DIVIDERS: [AnalogPin; 2] = [AnalogPin::Gp26, AnalogPin::Gp28];
const CURRENT_SENSOR: AnalogPin = AnalogPin::Gp27;

const AMPERES_PER_VOLT: f32 = 17.0;

const TICK_US: u64 = 100_000;

/// One tick after the cause, and another for rounding.
const TOLERANCE_S: f64 = 0.2;

/// Half throttle, so that the motors turn when allowed.
const THROTTLE: i16 = 500;

/// An autopilot that runs a story.
struct Stage {
    desk: Desk,
    /// Without a pack no voltage.
    readings: AnalogReadings,
    sensor_fails: bool,
    texts: Vec<(f64, String)>,
    drives: Vec<(f64, Drive)>,
    healths: Vec<(f64, Option<u8>)>,
    /// As reported, and true.
    charges: Vec<(f64, [Option<f32>; 2])>,
    source: Source,
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
        let mut readings = AnalogReadings::NONE;
        for pin in AnalogPin::ALL {
            readings.set(pin, Ok(AdcCount(0)));
        }
        Self {
            desk: Desk::starting(Start::with_parameters(parameters)),
            readings,
            sensor_fails: false,
            texts: Vec::new(),
            drives: Vec::new(),
            healths: Vec::new(),
            charges: Vec::new(),
            source: Source::default(),
        }
    }

    fn take(&mut self, input: Input) {
        self.source.take(input);
        match input {
            Input::Pack { .. } | Input::Unplug | Input::Plug | Input::Wire(_) | Input::Load { .. } => {}
            Input::Voltage { pack, volts } => self.set_pin(DIVIDERS[pack], volts / DIVIDER),
            Input::Current { pack, amperes } => {
                assert_eq!(pack, 0, "only the first pack has a current sensor");
                self.set_pin(CURRENT_SENSOR, amperes / AMPERES_PER_VOLT);
            }
            Input::SensorFails => self.sensor_fails = true,
            Input::SensorWorks => self.sensor_fails = false,
            Input::Request(request) => self.receive(&request.frames()),
        }
    }

    fn set_pin(&mut self, pin: AnalogPin, pin_v: f32) {
        self.readings.set(pin, Ok(adc_count(pin_v)));
    }

    fn receive(&mut self, request: &[u8]) {
        self.desk.receive_in_chunks(request, request.len());
    }

    fn readings(&self) -> AnalogReadings {
        let mut readings = self.readings;
        if self.sensor_fails {
            for pin in [DIVIDERS[0], CURRENT_SENSOR] {
                readings.set(pin, Err(ReadError::Timeout));
            }
        }
        readings
    }

    fn tick(&mut self) {
        let time_s = self.desk.now_us as f64 * 1e-6;
        if self.desk.vehicle().arm_state() == ArmState::Armed {
            self.receive(&manual_control(VEHICLE_ID, 0, THROTTLE));
        }
        if let Some(Supplied { volts, amperes }) = self.source.supply(TICK_US as f32 * 1e-6) {
            self.set_pin(DIVIDERS[0], volts / DIVIDER);
            self.set_pin(CURRENT_SENSOR, amperes / AMPERES_PER_VOLT);
        }
        self.desk.sample(self.readings());
        self.read_flash();
        let drives = self.desk.drive();
        self.drives.push((time_s, drive(drives.left)));
        let state = self.desk.autopilot.battery(Pack::First);
        self.healths.push((time_s, state.state_of_health_pct));
        self.charges
            .push((time_s, [state.readings.remaining_pct, self.source.charge_pct()]));
        self.desk.post_due(self.desk.now_us);
        let sent = self.desk.sent();
        let texts = sent.iter().filter(|frame| frame.message_id == STATUSTEXT);
        self.texts
            .extend(texts.map(|frame: &Frame| (time_s, frame.text(1, 50))));
        self.desk.now_us += TICK_US;
    }

    /// Nothing is learnt before flash was read; it is blank.
    fn read_flash(&mut self) {
        while let Some(job) = self.desk.next_flash_job(FlashStore::Learnt) {
            self.desk.flash_done(&job, Ok(None));
        }
    }

    fn check_healths(&self, story: &Story) {
        for (at_s, expected_pct) in story.healths() {
            let then = self.healths.iter().rfind(|(time_s, _)| *time_s <= at_s);
            story.check_health(at_s, then.expect("a tick").1, expected_pct);
        }
    }

    fn check_charges(&self, story: &Story) {
        for at_s in story.charges() {
            let then = self.charges.iter().rfind(|(time_s, _)| *time_s <= at_s);
            let [reported_pct, true_pct] = then.expect("a tick").1;
            story.check_charge(at_s, reported_pct, true_pct);
        }
    }

    fn check_motors(&self, story: &Story) {
        for (at_s, expected) in story.motors() {
            let then = self.drives.iter().rfind(|(time_s, _)| *time_s <= at_s);
            assert_eq!(then.expect("a tick").1, expected, "{} at {at_s} s", story.name);
        }
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
            stage.take(*input);
        }
        stage.tick();
    }
    story.check_texts(&stage.texts, TOLERANCE_S);
    stage.check_motors(story);
    stage.check_healths(story);
    stage.check_charges(story);
}

#[test]
// Requirement: AP-18
fn every_story_has_its_expected_outcomes() {
    for story in Story::all() {
        run(&story);
    }
}
