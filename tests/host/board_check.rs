//! `board-check` against the core: a sound board passes, and each fault fails the check it is for, and no other.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::io;
use std::rc::Rc;
use support::time::SECOND;

use proptest::prelude::*;
use rover_battmon::autopilot::{ParameterLoad, Start, Work};
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, Interruption, RunEnd, STACK_WORDS, TaskName};
use rover_battmon::memory::identity::FirmwareHash;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, VehicleParameter};
use rover_battmon::sensor::{ADC_REFERENCE_V, AnalogPin, AnalogReadings};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::{ArmState, MotorDrive, Restart, SideDrives};
use rover_battmon_tools::board_check::{
    CHECKS, Divider, Multimeter, Plan, Port, Report, Verdict, hash_of_elf, run,
};
use support::checked::{Turned, Watcher, failed, not_measured};
use support::desk::{DIVIDER, Desk, conversions, start_with};
use support::frames::{
    AUTOPILOT_VERSION, BATTERY_STATUS, COMMAND_LONG, GROUND_STATION, HEARTBEAT, PARAM_VALUE, SYS_STATUS,
    TIMESYNC, encode_v2, encode_v2_from, resealed,
};
use support::page::assert_part;
use support::requests::{arm_by_force, request_data_stream};

/// Of the stepped time.
const STEP_US: u64 = 5_000;
const SAMPLING_US: u64 = 100_000;
const DRIVE_US: u64 = 20_000;

/// From a restart's request to its silence, and to the first heartbeat.
const SHUTDOWN_US: u64 = 300_000;
const BOOT_US: u64 = 200_000;

/// A 2S pack behind the divider.
const PACK_V: f32 = 7.93;

/// All wheels at full throttle, which turn freely.
const FULL_LOAD_A: f32 = 1.2;
const FULL_LOAD_DROP_V: f32 = 0.3;

/// Of the default current sensor, in amperes a volt.
const AMP_PER_VOLT: f32 = 17.0;

/// When the check listens.
const LISTENING_US: u64 = 15 * SECOND;

/// What is wrong between board and check, or with the board.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    Silent,
    /// Anything comes instead of the board's frames, heartbeats of a ground station, too.
    NoBoard,
    PortCloses,
    VanishesWhileItRestarts,
    NeverComesBack,
    /// Probability that a byte is flipped or lost, of 65536, either way.
    Noise(u16),
    SecondBoard,
    WrongComponent,
    NotARover,
    WrongVersion,
    NoVersion,
    HalvedRate,
    Jitter,
    LostFrames,
    DamagedFrames,
    SlowAnswers,
    MissingParameter,
    ForgetsParameters,
    RestartIgnored,
    RestartsByItself,
    /// None, but its first heartbeat comes this many µs after its silence.
    BootsIn(u64),
    AnnouncesDamage,
    NoiseToTheBoard,
    Busy,
    SensorFailed,
    WrongCells,
    NoisyVoltage,
    NoCrashRecord,
    OtherCrashRecord,
    BeyondTheDivider,
    WeakDrivers,
    LeftReversed,
    SidesSwapped,
    ArmingRefused,
    /// The voltage is read at this moment of each period of the PWM.
    VoltageOfMoment(f32),
    CurrentOfMoment(f32),
    LightMotors,
    NoCurrentSensor,
    Armed,
}

/// The board: the core in stepped time.
struct DeskBoard {
    desk: Desk,
    /// When it started.
    started_us: u64,
    now_us: u64,
    restart_at_us: Option<u64>,
    noise: fastrand::Rng,
    /// Duty of each side, from −1 to 1.
    duties: [f32; 2],
    turned: Rc<RefCell<Turned>>,
    fault: Fault,
}

impl DeskBoard {
    fn new(fault: Fault, turned: Rc<RefCell<Turned>>) -> Self {
        let (cells, driver_limit_v) = match fault {
            Fault::WrongCells => (1.0, 11.0),
            Fault::BeyondTheDivider => (3.0, 0.0),
            Fault::WeakDrivers => (2.0, 7.0),
            _ => (2.0, 11.0),
        };
        let arming_v = if fault == Fault::ArmingRefused { 9.0 } else { 0.0 };
        let monitor = if fault == Fault::NoCurrentSensor { 3.0 } else { 4.0 };
        let start = start_with(&[
            ("BATT_MONITOR", monitor),
            ("BATT_CURR_PIN", 28.0),
            ("BATT_CELLS", cells),
            ("MOT_DRV_VOLT", driver_limit_v),
            ("BATT_ARM_VOLT", arming_v),
        ]);
        let mut board = Self {
            desk: Desk::with_own_drivers(start),
            started_us: 0,
            now_us: 0,
            restart_at_us: None,
            noise: fastrand::Rng::with_seed(1),
            duties: [0.0; 2],
            turned,
            fault,
        };
        board.open();
        if fault == Fault::Armed {
            board.desk.ask(&arm_by_force());
        }
        board
    }

    fn open(&mut self) {
        self.desk
            .autopilot
            .set_load(if self.fault == Fault::Busy { 900 } else { 8 });
        self.desk.autopilot.open(&mut self.desk.endpoint);
        if self.fault == Fault::AnnouncesDamage {
            let now = self.desk.now();
            self.desk.autopilot.announce(&ParameterLoad::Interrupted, now);
        }
    }

    fn restart(&mut self) {
        let how = self.desk.vehicle().pending_restart().unwrap_or_default();
        let mut parameters = self.desk.parameters().clone();
        if self.fault == Fault::ForgetsParameters {
            parameters
                .set(VehicleParameter::Sr0Params, 10.0)
                .expect("in range");
        }
        let has_record = how == Restart::Fault && self.fault != Fault::NoCrashRecord;
        self.desk = Desk::with_own_drivers(Start {
            run_end: match how {
                Restart::Fault => RunEnd::Interrupted(Interruption::Crash),
                Restart::Firmware | Restart::BootLoader => RunEnd::Complete,
            },
            crash: has_record.then(|| crash(self.fault)),
            ..Start::with_parameters(parameters)
        });
        self.started_us = self.now_us
            + match self.fault {
                Fault::BootsIn(boot_us) => boot_us,
                _ => BOOT_US,
            };
        self.open();
    }

    /// Returns the frames that were sent.
    fn step(&mut self) -> Vec<Vec<u8>> {
        self.now_us += STEP_US;
        if self.restart_at_us.is_some_and(|at_us| self.now_us >= at_us) {
            self.restart_at_us = None;
            self.restart();
        }
        if self.now_us < self.started_us {
            return Vec::new();
        }
        self.desk.now_us = self.now_us - self.started_us;
        if self.desk.now_us.is_multiple_of(SAMPLING_US) {
            let readings = self.readings();
            self.desk.sample(readings);
        }
        if self.desk.now_us.is_multiple_of(DRIVE_US) {
            let drives = self.desk.drive();
            self.note(drives);
        }
        if self.desk.next_due_us() <= self.desk.now_us || self.desk.now_us.is_multiple_of(SAMPLING_US) {
            self.desk.post_due(self.desk.now_us);
        }
        self.do_work();
        self.sent()
    }

    fn readings(&mut self) -> AnalogReadings {
        let (pack_v, noise_v) = match self.fault {
            // Full scale.
            Fault::BeyondTheDivider => (DIVIDER * ADC_REFERENCE_V, 0.01),
            Fault::NoisyVoltage => (PACK_V, 0.2),
            _ => (PACK_V, 0.01),
        };
        let (voltage_load, current_load) = match self.fault {
            Fault::VoltageOfMoment(moment) => (self.load_at(moment), self.load()),
            Fault::CurrentOfMoment(moment) => (self.load(), self.load_at(moment)),
            Fault::LightMotors => (0.1 * self.load(), self.load()),
            _ => (self.load(), self.load()),
        };
        let pack_v = pack_v - FULL_LOAD_DROP_V * voltage_load - noise_v * self.noise.f32();
        let current_a = FULL_LOAD_A * current_load;
        let mut readings = AnalogReadings::NONE;
        for pin in [AnalogPin::Gp26, AnalogPin::Gp27] {
            readings.set(pin, Ok(conversions(pack_v / DIVIDER)));
        }
        readings.set(AnalogPin::Gp28, Ok(conversions(current_a / AMP_PER_VOLT)));
        readings
    }

    /// Mean current of all motors, as a share of that at full throttle. Wheels that turn freely draw more than the duty's share.
    fn load(&self) -> f32 {
        self.duties.iter().map(|duty| duty.abs().powf(0.2)).sum::<f32>() / 2.0
    }

    /// Share of the motors that are switched on at a moment of a period.
    fn load_at(&self, moment: f32) -> f32 {
        let on = self.duties.iter().filter(|duty| duty.abs() > moment);
        on.count() as f32 / 2.0
    }

    fn note(&mut self, drives: SideDrives) {
        let duty = |drive| match drive {
            MotorDrive::Turn(duty) => duty,
            MotorDrive::Coast | MotorDrive::Brake => 0.0,
        };
        let (left, right) = (duty(drives.left), duty(drives.right));
        self.duties = [left, right];
        let (left, right) = match self.fault {
            Fault::LeftReversed => (-left, right),
            Fault::SidesSwapped => (right, left),
            _ => (left, right),
        };
        self.turned.borrow_mut().note(left, right);
    }

    fn do_work(&mut self) {
        let work = self.desk.autopilot.take_work();
        if work.contains(Work::RESTART) {
            self.restart_at_us = Some(self.now_us + SHUTDOWN_US);
        }
    }

    fn sent(&mut self) -> Vec<Vec<u8>> {
        let now = self.desk.now();
        let Desk {
            autopilot,
            endpoint,
            framer,
            ..
        } = &mut self.desk;
        std::iter::from_fn(|| Some(autopilot.next_frame(endpoint, framer, now)?.to_vec())).collect()
    }

    fn deliver(&mut self, bytes: &[u8]) {
        if self.now_us >= self.started_us {
            self.desk.receive_in_chunks(bytes, 64);
        }
    }
}

/// The record of the crash that was requested, or of another one.
fn crash(fault: Fault) -> CrashRecord {
    let (task, cause) = match fault {
        Fault::OtherCrashRecord => ("battery", CrashCause::Overdue),
        _ => (
            "reboot",
            CrashCause::Fault(FaultSite {
                pc: 0x1000_1234,
                lr: 0x1000_5679,
                xpsr: 0,
                stack: [0; STACK_WORDS],
            }),
        ),
    };
    CrashRecord {
        task: TaskName::new(task),
        cause,
        firmware: None,
    }
}

/// The line with someone in the middle.
struct TamperedLine {
    board: DeskBoard,
    /// Frames on their way, and when they arrive.
    on_the_way: Vec<(u64, Vec<u8>)>,
    frames: usize,
    sequence: u8,
    next_event_us: u64,
    has_happened: bool,
    random: fastrand::Rng,
}

impl TamperedLine {
    fn new(fault: Fault, turned: Rc<RefCell<Turned>>) -> Self {
        Self {
            board: DeskBoard::new(fault, turned),
            on_the_way: Vec::new(),
            frames: 0,
            sequence: 0,
            next_event_us: SECOND,
            has_happened: false,
            random: fastrand::Rng::with_seed(1),
        }
    }

    fn is_once(&mut self) -> bool {
        !std::mem::replace(&mut self.has_happened, true)
    }

    /// What happens at certain times.
    fn happen(&mut self) {
        if self.board.now_us < self.next_event_us {
            return;
        }
        self.next_event_us += SECOND;
        let fault = self.board.fault;
        match fault {
            Fault::SecondBoard => {
                let frame = encode_v2_from([2, 1], HEARTBEAT, &[0, 0, 0, 0, 10, 3, 81, 3, 3]);
                self.on_the_way.push((self.board.now_us, frame));
            }
            Fault::HalvedRate if self.is_once() => {
                const EXTENDED_STATUS: u8 = 2;
                self.board.deliver(&request_data_stream(EXTENDED_STATUS, 1, 1));
            }
            Fault::NoiseToTheBoard => {
                let mut damaged = encode_v2_from(GROUND_STATION, SYS_STATUS, &[1; 31]);
                damaged[12] ^= 1;
                self.board.deliver(&damaged);
            }
            Fault::RestartsByItself if self.board.now_us > LISTENING_US && self.is_once() => {
                self.board.restart()
            }
            _ => {}
        }
    }

    /// Takes a frame of the board.
    fn take(&mut self, mut frame: Vec<u8>) {
        self.frames += 1;
        let message_id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
        let is_fifth = self.frames.is_multiple_of(5);
        let mut delay_us = 0;
        match (self.board.fault, message_id) {
            (Fault::Silent | Fault::NoBoard, _) | (Fault::NoVersion, AUTOPILOT_VERSION) => return,
            (Fault::WrongComponent, _) => frame[6] = 7,
            // MAV_TYPE is the fifth byte: 2 is a quadrotor.
            (Fault::NotARover, HEARTBEAT) => frame[10 + 4] = 2,
            // The minor version.
            (Fault::WrongVersion, AUTOPILOT_VERSION) => frame[10 + 22] += 1,
            (Fault::Jitter, SYS_STATUS) if is_fifth => delay_us = 150_000,
            (Fault::SlowAnswers, TIMESYNC) => delay_us = 100_000,
            // The index.
            (Fault::MissingParameter, PARAM_VALUE) if frame[10 + 6] == 5 => return,
            // Bit 25 of the sensors that are healthy.
            (Fault::SensorFailed, SYS_STATUS) => frame[10 + 11] &= !2,
            _ => {}
        }
        self.on_the_way.push((self.board.now_us + delay_us, frame));
    }

    /// What arrives, renumbered, so that what was not lost on the way is not missing.
    fn arrive(&mut self) -> Vec<u8> {
        let now_us = self.board.now_us;
        let (arrived, on_the_way): (Vec<_>, _) =
            self.on_the_way.drain(..).partition(|(at_us, _)| *at_us <= now_us);
        self.on_the_way = on_the_way;
        arrived
            .into_iter()
            .flat_map(|(_, frame)| self.last_metre(frame))
            .collect()
    }

    fn last_metre(&mut self, mut frame: Vec<u8>) -> Vec<u8> {
        let is_of_the_board = frame[5] == 1;
        if is_of_the_board {
            frame[4] = self.sequence;
            self.sequence = self.sequence.wrapping_add(1);
        }
        let is_telemetry = [SYS_STATUS, BATTERY_STATUS].contains(&u32::from(frame[7]));
        let is_hit = is_telemetry && self.random.u8(..) < 40;
        let mut frame = resealed(&frame);
        match self.board.fault {
            Fault::LostFrames if is_hit => return Vec::new(),
            Fault::DamagedFrames if is_hit => frame[14] ^= 0x40,
            _ => {}
        }
        self.with_noise(frame)
    }

    fn with_noise(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        let Fault::Noise(rate) = self.board.fault else {
            return bytes;
        };
        bytes.retain(|_| self.random.u16(..) >= rate);
        for byte in &mut bytes {
            if self.random.u16(..) < rate {
                *byte ^= 1 << self.random.u8(..8);
            }
        }
        bytes
    }
}

impl Port for TamperedLine {
    fn now(&mut self) -> Instant {
        Instant::from_micros(self.board.now_us)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let is_restart = bytes[7] == COMMAND_LONG as u8 && bytes[10 + 28] == 246;
        if !(self.board.fault == Fault::RestartIgnored && is_restart) {
            let bytes = self.with_noise(bytes.to_vec());
            self.board.deliver(&bytes);
        }
        Ok(())
    }

    fn receive(&mut self, deadline: Instant, bytes: &mut Vec<u8>) -> io::Result<()> {
        let is_gone = match self.board.fault {
            Fault::PortCloses => self.board.now_us > LISTENING_US && self.is_once(),
            Fault::VanishesWhileItRestarts | Fault::NeverComesBack => {
                self.board.now_us < self.board.started_us
            }
            _ => false,
        };
        if is_gone {
            return Err(io::ErrorKind::NotConnected.into());
        }
        loop {
            for frame in self.board.step() {
                self.take(frame);
            }
            self.happen();
            bytes.extend(self.arrive());
            if self.board.fault == Fault::NoBoard {
                bytes.extend((0..100).map(|_| self.random.u8(..)));
                bytes.extend(encode_v2(HEARTBEAT, &[0, 0, 0, 0, 6, 8, 0, 4, 3]));
            }
            if !bytes.is_empty() || self.board.now_us >= deadline.as_micros() {
                return Ok(());
            }
        }
    }

    fn reopen(&mut self, _: Instant) -> io::Result<()> {
        if self.board.fault == Fault::NeverComesBack {
            return Err(io::ErrorKind::NotConnected.into());
        }
        let until_us = self.board.started_us + STEP_US;
        while self.board.step().is_empty() && self.board.now_us < until_us {}
        Ok(())
    }
}

const EVERYTHING: Plan = Plan {
    provoke_fault: true,
    turn_motors: true,
    multimeter: Multimeter::Ask,
    apply_calibration: false,
    divider: Divider::AsBefore,
    firmware_hash: None,
};

const MOTORS: [&str; 4] = [
    "left wheels ahead",
    "right wheels ahead",
    "left wheels back",
    "right wheels back",
];

const UNDER_LOAD: [&str; 2] = ["voltage under load", "current under load"];

fn check_beside(owner: &mut Watcher, fault: Fault, plan: &Plan) -> (Report, TamperedLine) {
    let mut line = TamperedLine::new(fault, owner.turned.clone());
    let report = run(&mut line, owner, plan);
    (report, line)
}

fn check(fault: Fault, plan: &Plan) -> Report {
    let mut owner = Watcher {
        multimeter: "7,93",
        ..Watcher::default()
    };
    let (report, _) = check_beside(&mut owner, fault, plan);
    assert_eq!(owner.shown.last(), Some(&report.summary()));
    report
}

/// Checks everything of a board whose fault must not count.
fn check_sound(fault: Fault) -> Report {
    let report = check(fault, &EVERYTHING);
    assert_eq!(failed(&report), [""; 0], "{fault:?}\n{}", report.markdown("desk"));
    report
}

#[test]
fn a_sound_board_passes_and_what_it_does_not_send_is_not_measured() {
    let report = check_sound(Fault::None);
    assert_eq!(not_measured(&report), ["firmware hash", "serial number"]);
    assert_eq!(report.verdict(), Verdict::Passed);
}

#[test]
fn what_was_not_asked_for_is_not_measured() {
    let report = check(Fault::None, &Plan::default());
    assert_eq!(report.verdict(), Verdict::Passed);
    let others = ["firmware hash", "serial number", "calibration", "crash record"];
    assert_eq!(
        not_measured(&report),
        [&others[..], &MOTORS, &UNDER_LOAD].concat()
    );
}

#[test]
fn a_pack_that_the_motors_hardly_load_is_not_measured_under_load() {
    let report = check_sound(Fault::LightMotors);
    assert_eq!(not_measured(&report)[2..], UNDER_LOAD);
    let report = check_sound(Fault::NoCurrentSensor);
    assert_eq!(not_measured(&report)[2..], ["current under load"]);
}

#[test]
fn wheels_that_turn_wrong_are_not_driven_at_full_speed() {
    let report = check(Fault::LeftReversed, &EVERYTHING);
    assert_eq!(not_measured(&report)[2..], UNDER_LOAD);
}

#[test]
fn each_fault_fails_its_check_and_no_other() {
    let plan = EVERYTHING;
    let other_build = Plan {
        firmware_hash: Some(FirmwareHash::of([1])),
        ..plan
    };
    let other_voltage = Plan {
        multimeter: Multimeter::Shows(8.4),
        ..plan
    };
    let beyond = Plan {
        multimeter: Multimeter::None,
        ..plan
    };
    let and_motors = |checks: &[&'static str]| [checks, &MOTORS].concat();
    let without_voltage = and_motors(&["sensor health", "voltage"]);
    let without_drivers = and_motors(&["motor drivers"]);
    let cases: Vec<(Fault, Plan, &[&str])> = vec![
        (Fault::PortCloses, plan, &["connection"]),
        (Fault::SecondBoard, plan, &["one board"]),
        (Fault::WrongComponent, plan, &["identity"]),
        (Fault::NotARover, plan, &["identity"]),
        (Fault::WrongVersion, plan, &["version"]),
        (Fault::NoVersion, plan, &["version"]),
        (Fault::None, other_build, &["firmware hash"]),
        (Fault::HalvedRate, plan, &["rates"]),
        (Fault::Jitter, plan, &["jitter"]),
        (Fault::LostFrames, plan, &["lost frames"]),
        (Fault::DamagedFrames, plan, &["damaged frames"]),
        (Fault::SlowAnswers, plan, &["round trips"]),
        (Fault::MissingParameter, plan, &["parameter list"]),
        (Fault::ForgetsParameters, plan, &["parameter kept"]),
        (Fault::RestartIgnored, plan, &["parameter kept", "crash record"]),
        (Fault::RestartsByItself, plan, &["restarts"]),
        (Fault::AnnouncesDamage, plan, &["announcements"]),
        (Fault::NoiseToTheBoard, plan, &["board's errors"]),
        (Fault::Busy, plan, &["load"]),
        (Fault::SensorFailed, plan, &["sensor health"]),
        (Fault::WrongCells, plan, &without_voltage),
        (Fault::NoisyVoltage, plan, &["voltage noise"]),
        (Fault::None, other_voltage, &["calibration"]),
        (Fault::NoCrashRecord, plan, &["crash record"]),
        (Fault::OtherCrashRecord, plan, &["crash record"]),
        (Fault::BeyondTheDivider, beyond, &["voltage"]),
        (Fault::WeakDrivers, plan, &without_drivers),
        (
            Fault::LeftReversed,
            plan,
            &["left wheels ahead", "left wheels back"],
        ),
        (Fault::SidesSwapped, plan, &MOTORS),
        (Fault::VoltageOfMoment(0.1), plan, &UNDER_LOAD),
        (Fault::VoltageOfMoment(0.6), plan, &UNDER_LOAD),
        (Fault::CurrentOfMoment(0.1), plan, &["current under load"]),
        (Fault::CurrentOfMoment(0.6), plan, &["current under load"]),
        (Fault::ArmingRefused, plan, &MOTORS),
    ];
    let mut failing = BTreeSet::new();
    for (fault, plan, expected) in cases {
        let report = check(fault, &plan);
        assert_eq!(
            failed(&report),
            expected,
            "{fault:?}\n{}",
            report.markdown("desk")
        );
        assert_eq!(report.verdict(), Verdict::Failed);
        assert_eq!(report.findings().len(), expected.len());
        failing.extend(expected);
    }
    // A board without a serial number has not failed.
    let all = CHECKS
        .iter()
        .map(|check| check.name)
        .filter(|name| *name != "serial number");
    assert_eq!(failing, all.collect(), "every check has a fault that fails it");
}

#[test]
fn an_armed_rover_is_not_checked() {
    let mut owner = Watcher::default();
    let (report, line) = check_beside(&mut owner, Fault::Armed, &EVERYTHING);
    assert_eq!(report.verdict(), Verdict::Armed);
    let said = "The rover is armed, and a check restarts it: disarm it first.";
    assert_eq!(owner.shown, ["Waiting for the board's heartbeat", said]);
    // It was asked nothing, and goes on.
    assert_eq!(line.board.started_us, 0);
    assert_eq!(line.board.desk.vehicle().arm_state(), ArmState::Armed);
}

#[test]
fn without_a_board_nothing_else_is_measured() {
    let report = check(Fault::Silent, &EVERYTHING);
    assert_eq!(report.verdict(), Verdict::NotConnected);
    assert_eq!(failed(&report), ["connection"]);
    assert_eq!(not_measured(&report).len(), CHECKS.len() - 1);
    let report = check(Fault::NoBoard, &Plan::default());
    assert_eq!(report.verdict(), Verdict::NotConnected);
}

#[test]
fn the_exact_multiplier_is_set_on_request() {
    let plan = Plan {
        multimeter: Multimeter::Shows(8.4),
        apply_calibration: true,
        ..Plan::default()
    };
    let (report, line) = check_beside(&mut Watcher::default(), Fault::None, &plan);
    let text = report.markdown("desk");
    assert_eq!(failed(&report), [""; 0], "{text}");
    assert!(text.contains("Battery 1 estimate restarted"), "{text}");
    let multiplier = line
        .board
        .desk
        .parameters()
        .get(BatteryParameter::VoltMult.of(Pack::First));
    assert!((multiplier - DIVIDER * 8.4 / PACK_V).abs() < 0.01, "{multiplier}");
}

/// The factor after a check that may set it, of a board whose pin and factor were these; and whether the check failed.
fn calibrated(pin: f32, factor: f32, measured_v: f32, divider: Divider) -> (f32, bool) {
    let plan = Plan {
        multimeter: Multimeter::Shows(measured_v),
        apply_calibration: true,
        divider,
        ..Plan::default()
    };
    let mut owner = Watcher::default();
    let mut line = TamperedLine::new(Fault::None, owner.turned.clone());
    let desk = &mut line.board.desk;
    desk.set(BatteryParameter::VoltPin.of(Pack::First), pin);
    desk.set(BatteryParameter::VoltMult.of(Pack::First), factor);
    let report = run(&mut line, &mut owner, &plan);
    let parameters = line.board.desk.parameters();
    let is_failed = failed(&report).contains(&"calibration");
    (
        parameters.get(BatteryParameter::VoltMult.of(Pack::First)),
        is_failed,
    )
}

#[test]
fn an_impossible_multimeter_is_a_failed_check_that_changes_nothing() {
    const OWN_PIN: f32 = 26.0;
    const OTHER_PIN: f32 = 27.0;
    // The pack's voltage at the pin.
    let pin_v = PACK_V / DIVIDER;
    for (pin, factor, exact, divider, is_set) in [
        (OWN_PIN, DIVIDER, 3.2 * DIVIDER, Divider::AsBefore, false),
        (OWN_PIN, DIVIDER, 1.16 * DIVIDER, Divider::AsBefore, false),
        (OWN_PIN, DIVIDER, 0.84 * DIVIDER, Divider::AsBefore, false),
        (OWN_PIN, DIVIDER, 1.14 * DIVIDER, Divider::AsBefore, true),
        (OWN_PIN, DIVIDER, 0.86 * DIVIDER, Divider::AsBefore, true),
        (OWN_PIN, DIVIDER, 3.2 * DIVIDER, Divider::Changed, true),
        // A factor that was set wrong before.
        (OWN_PIN, 3.2 * DIVIDER, 1.02 * DIVIDER, Divider::AsBefore, true),
        (OWN_PIN, 3.2 * DIVIDER, 2.0 * DIVIDER, Divider::AsBefore, false),
        // A divider that was changed before.
        (OWN_PIN, 2.0 * DIVIDER, 2.1 * DIVIDER, Divider::AsBefore, true),
        // Of another pin's divider nothing is known at first.
        (OTHER_PIN, DIVIDER, 3.2 * DIVIDER, Divider::AsBefore, true),
        (OTHER_PIN, 2.0 * DIVIDER, 3.2 * DIVIDER, Divider::AsBefore, false),
        (OTHER_PIN, 2.0 * DIVIDER, DIVIDER, Divider::AsBefore, false),
        (OTHER_PIN, 2.0 * DIVIDER, 2.2 * DIVIDER, Divider::AsBefore, true),
    ] {
        let (now, is_failed) = calibrated(pin, factor, pin_v * exact, divider);
        let expected = if is_set { exact } else { factor };
        assert!(
            (now - expected).abs() < 0.01 * expected,
            "{now} of {factor}, exact {exact}, pin {pin}"
        );
        assert_eq!(is_failed, !is_set, "{factor}, exact {exact}, pin {pin}");
    }
}

#[test]
fn ctrl_c_while_the_wheels_turn_stops_them() {
    let mut owner = Watcher {
        is_startled: true,
        ..Watcher::default()
    };
    let plan = Plan {
        turn_motors: true,
        ..Plan::default()
    };
    let (report, mut line) = check_beside(&mut owner, Fault::None, &plan);
    assert_ne!(*owner.turned.borrow(), Turned::default(), "it turned");
    assert_eq!(line.board.desk.drive(), SideDrives::COAST);
    assert_eq!(report.verdict(), Verdict::Failed);
    assert!(not_measured(&report).contains(&"left wheels ahead"));
}

#[test]
fn the_parameter_has_its_old_value_afterwards() {
    for fault in [Fault::None, Fault::RestartIgnored, Fault::ForgetsParameters] {
        let (_, line) = check_beside(&mut Watcher::default(), fault, &Plan::default());
        let rate = line.board.desk.parameters().get(VehicleParameter::Sr0Params);
        assert_eq!(rate, 10.0, "{fault:?}");
    }
}

/// Of a run that lost its board before the value was set back.
#[test]
fn the_value_of_an_earlier_check_is_not_taken_for_the_original() {
    for (found, original) in [(11.0, 10.0), (12.0, 10.0), (13.0, 13.0), (50.0, 50.0)] {
        let mut owner = Watcher::default();
        let mut line = TamperedLine::new(Fault::None, owner.turned.clone());
        line.board.desk.set(VehicleParameter::Sr0Params, found);
        let report = run(&mut line, &mut owner, &Plan::default());
        assert_eq!(failed(&report), [""; 0], "{found}");
        let rate = line.board.desk.parameters().get(VehicleParameter::Sr0Params);
        assert_eq!(rate, original, "{found}");
        let is_said = report
            .markdown("desk")
            .contains(&format!("an earlier check has left {found}"));
        assert_eq!(is_said, found != original);
    }
}

#[test]
fn an_answer_that_is_no_voltage_is_asked_again_and_an_empty_line_skips() {
    for (multimeter, asked_again, outcome) in [
        ("12.6V|about 8|-7.93|nan|7,93", 4, None),
        ("12.6V|", 1, Some("calibration")),
        (" |7.93", 0, Some("calibration")),
    ] {
        let mut owner = Watcher {
            multimeter,
            ..Watcher::default()
        };
        let plan = Plan {
            multimeter: Multimeter::Ask,
            ..Plan::default()
        };
        let (report, _) = check_beside(&mut owner, Fault::None, &plan);
        let lines = owner
            .shown
            .iter()
            .filter(|line| line.contains("A number above 0"));
        assert_eq!(lines.count(), asked_again, "{multimeter}");
        let not_measured = not_measured(&report);
        let found = not_measured.iter().find(|name| **name == "calibration");
        assert_eq!(found.copied(), outcome, "{multimeter}");
    }
}

#[test]
fn ctrl_c_behind_the_set_parameter_sets_it_back() {
    let mut owner = Watcher {
        stops_after: Some("Setting a parameter"),
        ..Watcher::default()
    };
    let (report, line) = check_beside(&mut owner, Fault::None, &Plan::default());
    assert_eq!(failed(&report), ["parameter kept"]);
    let findings = report.findings();
    assert!(findings[0].contains("it was 10, and may be 11"), "{findings:?}");
    let rate = line.board.desk.parameters().get(VehicleParameter::Sr0Params);
    assert_eq!(rate, 10.0);
}

#[test]
fn restarts_within_a_second_are_distinguished() {
    for boot_us in (10_000..300_000).step_by(50_000) {
        check_sound(Fault::BootsIn(boot_us));
    }
}

#[test]
fn a_port_that_vanishes_while_the_board_restarts_is_opened_again() {
    check_sound(Fault::VanishesWhileItRestarts);
    let report = check(Fault::NeverComesBack, &EVERYTHING);
    assert_eq!(failed(&report), ["connection", "parameter kept"]);
    assert!(not_measured(&report).contains(&"crash record"));
    let findings = report.findings();
    assert!(
        findings[1].contains("it was 10, and may be 11. Set 10."),
        "{findings:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the line does to either side, there is a report, and what may still turn stops by the board's time-out.
    #[test]
    fn any_noise_ends_in_a_report_and_standing_wheels(rate in 0_u16..3000, seed: u64) {
        let mut owner = Watcher::default();
        let mut line = TamperedLine::new(Fault::Noise(rate), owner.turned.clone());
        line.random = fastrand::Rng::with_seed(seed);
        let report = run(&mut line, &mut owner, &EVERYTHING);
        prop_assert_eq!(report.rows().len(), CHECKS.len());
        let end_us = line.board.now_us + 3 * SECOND;
        while line.board.now_us < end_us {
            line.board.step();
        }
        let drives = line.board.desk.vehicle().drives();
        prop_assert!([SideDrives::COAST, SideDrives::BRAKE].contains(&drives), "{:?}", drives);
    }
}

#[test]
fn the_checks_are_on_the_page() {
    let mut list = String::new();
    for alike in CHECKS.chunk_by(|one, next| one.measures == next.measures) {
        let names: Vec<_> = alike.iter().map(|check| check.name).collect();
        list += &format!("- {}: {}\n", names.join(", "), alike[0].measures);
    }
    assert_part("checks", &list);
}

/// The start of an ELF file of 32 bits, little-endian, of the current version.
const ELF_START: &[u8] = b"\x7fELF\x01\x01\x01";

/// An ELF file of 32 bits with these segments: type, address, bytes.
fn elf_file(segments: &[(u32, u32, &[u8])]) -> Vec<u8> {
    const HEADER_BYTES: usize = 52;
    const PROGRAM_HEADER_BYTES: usize = 32;
    let mut file = ELF_START.to_vec();
    file.resize(HEADER_BYTES, 0);
    file[0x1c] = HEADER_BYTES as u8;
    file[0x2a] = PROGRAM_HEADER_BYTES as u8;
    file[0x2c] = segments.len() as u8;
    let mut contents: Vec<u8> = Vec::new();
    for (kind, address, bytes) in segments {
        let offset = HEADER_BYTES + segments.len() * PROGRAM_HEADER_BYTES + contents.len();
        let size = bytes.len() as u32;
        for word in [*kind, offset as u32, 0x2000_0000, *address, size, size, 0, 4] {
            file.extend(word.to_le_bytes());
        }
        contents.extend(*bytes);
    }
    file.extend(contents);
    file
}

#[test]
fn the_hash_of_a_file_is_that_of_its_loaded_segments_by_their_addresses() {
    const LOAD: u32 = 1;
    const NOTE: u32 = 4;
    let file = elf_file(&[
        (LOAD, 0x1000_0100, b"5678"),
        (NOTE, 0x1000_0080, b"note"),
        (LOAD, 0x2000_b000, b""),
        (LOAD, 0x1000_0000, b"1234"),
    ]);
    // `zlib.crc32(b"12345678")`
    let hash = hash_of_elf(&file).expect("a whole file");
    assert_eq!(&hash.digits(), b"9ae0daaf");
    for length in 0..file.len() {
        assert_eq!(
            hash_of_elf(&file[..length]),
            None,
            "{length} of {} bytes",
            file.len()
        );
    }
    assert_eq!(hash_of_elf(&elf_file(&[(NOTE, 0, b"note")])), None);
    assert_eq!(hash_of_elf(&elf_file(&[(LOAD, 0, b"odd")])), None);
}

proptest! {
    #[test]
    fn any_file_has_a_hash_or_none(start in 0..=ELF_START.len(), rest in prop::collection::vec(any::<u8>(), 0..200)) {
        let file = [&ELF_START[..start], &rest].concat();
        let _ = hash_of_elf(&file);
    }
}
