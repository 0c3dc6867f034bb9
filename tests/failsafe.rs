//! A rover whose battery or driver fails, in stepped time: from the converter to the motors and the wire.

#[path = "support/line.rs"]
mod line;
mod support;

use std::cell::RefCell;

use embassy_futures::join::join4;
use embassy_futures::select::select;
use embassy_time::{Duration, Instant, Timer};
use line::{BYTE_US, Line};
use rover_battmon::battery::{ReadError, RetainedRecord};
use rover_battmon::liveness::CheckIn;
use rover_battmon::mavlink::{LinkKind, Signing};
use rover_battmon::parameter::{BatteryParameter, Pack, ParameterId, Parameters, VehicleParameter};
use rover_battmon::sensor::{AdcCount, AnalogIn, AnalogPin};
use rover_battmon::sim::clock;
use rover_battmon::tasks::{
    ByteSource, Link, ReceiveError, Shared, drive, read_frames, sample_batteries, schedule_telemetry,
    write_frames,
};
use rover_battmon::vehicle::{Colour, Indication, Indicators, MotorDrive, Motors, SideDrives, Tone};
use support::frames::{Frame, HEARTBEAT, Heartbeat, STATUSTEXT, SYS_STATUS, SysStatus, frames, of_message};
use support::requests::{arm, command_long_2, do_set_mode, manual_control};

const MILLISECOND: u64 = 1_000;
const SECOND: u64 = 1_000_000;

/// A full 2S pack, 7.9 V, and an empty one, 6.4 V.
const FULL: AdcCount = AdcCount(2482);
const EMPTY: AdcCount = AdcCount(2000);

/// The driver is there from here on, and drives at once.
const ARMED_AT_US: u64 = SECOND;

/// What a run is like.
struct Scenario<'a> {
    parameters: &'a [(BatteryParameter, f32)],
    /// When the pack is empty at once.
    empty_at_us: u64,
    /// When the driver stops sending.
    silent_at_us: u64,
    /// Something else that is sent once.
    request: (u64, Vec<u8>),
}

impl Default for Scenario<'_> {
    fn default() -> Self {
        Self {
            parameters: &[],
            empty_at_us: u64::MAX,
            silent_at_us: u64::MAX,
            request: (u64::MAX, Vec::new()),
        }
    }
}

/// What came of it: all that the motors and the lamps were told, with the time, and what was sent.
struct Outcome {
    drives: Vec<(u64, SideDrives)>,
    shown: Vec<(u64, Indication)>,
    frames: Vec<Frame>,
}

impl Outcome {
    /// When the motors were first told this after `from_us`.
    fn told_at(&self, from_us: u64, drives: SideDrives) -> u64 {
        let told = self
            .drives
            .iter()
            .find(|(at_us, told)| *at_us >= from_us && *told == drives);
        told.expect("the motors are told so").0
    }

    fn texts(&self) -> Vec<String> {
        of_message(&self.frames, STATUSTEXT)
            .iter()
            .map(|frame| frame.text(1, 50))
            .collect()
    }

    /// The state in the last HEARTBEAT.
    fn last_state(&self) -> u8 {
        let heartbeats = of_message(&self.frames, HEARTBEAT);
        Heartbeat(heartbeats[heartbeats.len() - 1]).system_status()
    }
}

struct Converter {
    empty_at_us: u64,
}

impl AnalogIn for Converter {
    async fn convert(&mut self, _: AnalogPin) -> Result<AdcCount, ReadError> {
        let is_empty = Instant::now().as_micros() >= self.empty_at_us;
        Ok(if is_empty { EMPTY } else { FULL })
    }
}

/// Arms, sets the mode MANUAL, and pushes the throttle ten times a second.
struct Driver<'a> {
    scenario: &'a Scenario<'a>,
    waiting: Vec<u8>,
    next_at_us: u64,
    has_asked: bool,
}

impl Driver<'_> {
    /// What is sent at this moment.
    fn says(&mut self, now_us: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        if now_us == ARMED_AT_US {
            bytes.extend([arm(), do_set_mode(0.0)].concat());
        }
        if now_us < self.scenario.silent_at_us {
            bytes.extend(manual_control(1, 0, 1000));
        }
        let (at_us, request) = &self.scenario.request;
        if now_us >= *at_us && !self.has_asked {
            self.has_asked = true;
            bytes.extend(request);
        }
        bytes
    }
}

impl ByteSource for Driver<'_> {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        while self.waiting.is_empty() {
            Timer::at(Instant::from_micros(self.next_at_us)).await;
            self.waiting = self.says(self.next_at_us);
            self.next_at_us += 100 * MILLISECOND;
        }
        let taken = buffer.len().min(self.waiting.len());
        buffer[..taken].copy_from_slice(&self.waiting[..taken]);
        self.waiting.drain(..taken);
        Ok(taken)
    }
}

struct Wheels<'a>(&'a RefCell<Vec<(u64, SideDrives)>>);

impl Motors for Wheels<'_> {
    fn drive(&mut self, drives: SideDrives) {
        self.0.borrow_mut().push((Instant::now().as_micros(), drives));
    }
}

struct Lamps<'a>(&'a RefCell<Vec<(u64, Indication)>>);

impl Indicators for Lamps<'_> {
    fn show(&mut self, indication: Indication) {
        self.0.borrow_mut().push((Instant::now().as_micros(), indication));
    }
}

fn run(seconds: u64, scenario: &Scenario<'_>) -> Outcome {
    let check_in = CheckIn::new("", u32::MAX);
    let mut parameters = Parameters::defaults();
    // The levers are followed at once.
    parameters.set(VehicleParameter::MotSlewrate, 0.0).unwrap();
    for (parameter, value) in [(BatteryParameter::Cells, 2.0)].iter().chain(scenario.parameters) {
        let id: ParameterId = parameter.of(Pack::First);
        parameters.set(id, *value).unwrap();
    }
    let (drives, shown, sent) = (RefCell::default(), RefCell::default(), RefCell::default());
    let mut memory = [RetainedRecord::BLANK; 2];
    let driver = Driver {
        scenario,
        waiting: Vec::new(),
        next_at_us: ARMED_AT_US,
        has_asked: false,
    };
    let pack = Converter {
        empty_at_us: scenario.empty_at_us,
    };
    clock::run_for(Duration::from_secs(seconds), async {
        let (shared, link) = (
            Shared::new(&parameters, Signing::off()),
            Link::new("line", LinkKind::Radio, 11_520),
        );
        join4(
            sample_batteries(pack, &mut memory, &shared, &check_in),
            drive(Wheels(&drives), Lamps(&shown), &shared, &check_in),
            schedule_telemetry(&shared, &link, &check_in),
            select(
                read_frames(driver, &shared, &link, &check_in),
                write_frames(
                    Line {
                        byte_us: BYTE_US,
                        sent: &sent,
                    },
                    &shared,
                    &link,
                    &check_in,
                ),
            ),
        )
        .await
    });
    Outcome {
        drives: drives.into_inner(),
        shown: shown.into_inner(),
        frames: frames(&sent.into_inner()),
    }
}

const AHEAD: SideDrives = SideDrives {
    left: MotorDrive::Turn(1.0),
    right: MotorDrive::Turn(1.0),
};

const STANDBY_STATE: u8 = 3;
const ACTIVE_STATE: u8 = 4;
const CRITICAL_STATE: u8 = 5;
const EMERGENCY_STATE: u8 = 6;

const HOLD_WHEN_CRITICAL: [(BatteryParameter, f32); 3] = [
    (BatteryParameter::CrtVolt, 7.0),
    (BatteryParameter::LowTimer, 1.0),
    (BatteryParameter::FsCrtAct, 2.0),
];

#[test]
fn the_driver_drives_at_once_and_as_long_as_the_battery_is_well() {
    let outcome = run(10, &Scenario::default());
    let driving_at_us = outcome.told_at(0, AHEAD);
    assert!(driving_at_us - ARMED_AT_US <= 5 * MILLISECOND, "{driving_at_us}");
    assert!(
        outcome
            .drives
            .iter()
            .all(|(at_us, drives)| (*drives == AHEAD) == (*at_us >= driving_at_us)
                || at_us.abs_diff(ARMED_AT_US) <= 5 * MILLISECOND)
    );
    // 50 times a second, and once more for each message of the driver.
    assert!(
        (590..=620).contains(&outcome.drives.len()),
        "{}",
        outcome.drives.len()
    );
    assert_eq!(outcome.last_state(), ACTIVE_STATE);
    assert_eq!(outcome.texts(), ["Battery failsafes are off: set BATT_LOW_VOLT"]);
}

#[test]
fn a_critical_battery_holds_the_rover_within_the_tick_that_decides() {
    // Anywhere between two ticks of the battery.
    for offset_us in (0..100).step_by(7).map(|offset| offset * MILLISECOND) {
        let empty_at_us = 5 * SECOND + offset_us;
        let outcome = run(
            10,
            &Scenario {
                parameters: &HOLD_WHEN_CRITICAL,
                empty_at_us,
                ..Scenario::default()
            },
        );
        let held_at_us = outcome.told_at(empty_at_us, SideDrives::BRAKE);
        // Seen in the next tick, and a timer of 1 s has run out when more than that has passed.
        let seen_at_us = empty_at_us.next_multiple_of(100 * MILLISECOND);
        let decided_at_us = seen_at_us + 1_100 * MILLISECOND;
        assert!(
            (decided_at_us..decided_at_us + MILLISECOND).contains(&held_at_us),
            "{held_at_us} after {empty_at_us}"
        );
        assert!(held_at_us - empty_at_us <= 1_250 * MILLISECOND);
        // The driver still pushes the throttle.
        assert!(
            outcome
                .drives
                .iter()
                .all(|(at_us, drives)| *at_us <= held_at_us || *drives == SideDrives::BRAKE)
        );
        assert_eq!(outcome.texts(), ["Battery 1 is critical 6.37V used 0 mAh"]);
        assert_eq!(outcome.last_state(), CRITICAL_STATE);
        let sys_status = of_message(&outcome.frames, SYS_STATUS);
        assert_eq!(SysStatus(sys_status[sys_status.len() - 1]).sensors_healthy(), 0);
        let (_, shown) = outcome.shown[outcome.shown.len() - 1];
        assert_eq!(shown.colour, Colour::Red);
        assert!(
            outcome
                .shown
                .iter()
                .any(|(at_us, shown)| *at_us > held_at_us && shown.tone == Tone::Sounding)
        );
    }
}

#[test]
fn hold_is_left_on_command_though_the_battery_is_still_critical() {
    let outcome = run(
        10,
        &Scenario {
            parameters: &HOLD_WHEN_CRITICAL,
            empty_at_us: 5 * SECOND,
            request: (8 * SECOND, do_set_mode(0.0)),
            ..Scenario::default()
        },
    );
    let (_, last) = outcome.drives[outcome.drives.len() - 1];
    assert_eq!(last, AHEAD);
    assert_eq!(outcome.last_state(), CRITICAL_STATE);
}

#[test]
fn an_action_that_needs_a_position_holds_and_says_so() {
    let mut parameters = HOLD_WHEN_CRITICAL;
    parameters[2].1 = 1.0;
    let outcome = run(
        10,
        &Scenario {
            parameters: &parameters,
            empty_at_us: 5 * SECOND,
            ..Scenario::default()
        },
    );
    outcome.told_at(5 * SECOND, SideDrives::BRAKE);
    assert_eq!(
        outcome.texts(),
        [
            "Battery 1 is critical 6.37V used 0 mAh",
            "RTL needs a position: Hold"
        ]
    );
}

#[test]
fn termination_lets_it_roll_until_the_battery_is_reset() {
    const BATTERY_RESET: u16 = 42651;
    let mut parameters = HOLD_WHEN_CRITICAL;
    parameters[2].1 = 5.0;
    let mut scenario = Scenario {
        parameters: &parameters,
        empty_at_us: 5 * SECOND,
        request: (8 * SECOND, command_long_2(400, 1.0, 21196.0)),
        ..Scenario::default()
    };
    let outcome = run(10, &scenario);
    let (_, last) = outcome.drives[outcome.drives.len() - 1];
    assert_eq!(last, SideDrives::COAST);
    assert_eq!(outcome.last_state(), EMERGENCY_STATE);
    assert_eq!(
        outcome.texts()[1..],
        [
            "Terminated by battery failsafe",
            "Arm: Terminated: reset the battery or restart"
        ]
    );
    scenario.request.1 = command_long_2(BATTERY_RESET, 1.0, 100.0);
    let outcome = run(10, &scenario);
    assert_eq!(outcome.last_state(), STANDBY_STATE);
}

#[test]
fn a_warning_drives_on() {
    let outcome = run(
        10,
        &Scenario {
            parameters: &[
                (BatteryParameter::LowVolt, 7.0),
                (BatteryParameter::LowTimer, 1.0),
            ],
            empty_at_us: 5 * SECOND,
            ..Scenario::default()
        },
    );
    let (_, last) = outcome.drives[outcome.drives.len() - 1];
    assert_eq!(last, AHEAD);
    assert_eq!(outcome.texts(), ["Battery 1 is low 6.37V used 0 mAh"]);
    assert_eq!(outcome.last_state(), CRITICAL_STATE);
}

#[test]
fn a_driver_who_falls_silent_stops_the_rover_after_the_timeout() {
    let outcome = run(
        10,
        &Scenario {
            parameters: &[(BatteryParameter::LowVolt, 7.0)],
            silent_at_us: 5 * SECOND,
            ..Scenario::default()
        },
    );
    // The last message came at 4.9 s; the drive looks every 20 ms whether 1.5 s have passed.
    let held_at_us = outcome.told_at(5 * SECOND, SideDrives::BRAKE);
    assert!(
        (6_400 * MILLISECOND..=6_420 * MILLISECOND).contains(&held_at_us),
        "{held_at_us}"
    );
    assert_eq!(outcome.texts(), ["Radio Failsafe: Hold"]);
    assert_eq!(outcome.last_state(), CRITICAL_STATE);
}
