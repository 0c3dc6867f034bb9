//! Requests of a ground station to the rover: frames in, frames and motor outputs out.

use rover_battmon::autopilot::Start;
use rover_battmon::battery::{Amount, BatteryState, FailsafeLevel, ReadError};
use rover_battmon::mavlink::{Event, Framer, LinkKind, Stream};
use rover_battmon::memory::flash_chip::RegisterWear;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, ParameterId, Parameters, StickParameter, VehicleParameter};
use rover_battmon::sensor::{AnalogPin, AnalogReadings, Conversions};
use rover_battmon::vehicle::{MotorDrive, SideDrives};
use support::commands::{
    ACCEPTED, ARM_DISARM, BATTERY_RESET, DENIED, FAILED, FORCED, RUN_PREARM_CHECKS, TEMPORARILY_REJECTED,
    UNSUPPORTED,
};
use support::desk::{Desk, LOW_VOLT, conversions, start_with};
use support::firmware_version;
use support::frames::{
    COMMAND_ACK, CRITICAL, Frame, Heartbeat, PARAM_ERROR, ParamValue, STATUSTEXT, SysStatus, frames,
    of_message, resealed,
};
use support::requests::{
    GCS, MANUAL, ONBOARD_CONTROLLER, VEHICLE, arm, arm_by_force, command_int, command_int_2, command_long,
    command_long_2, disarm, do_set_mode, heartbeat, heartbeat_from, manual_control, param_request_list,
    param_set, provoke_fault, rc_override, reboot, reboot_to_boot_loader, set_mode,
};

use crate::builders::healthy;

const DO_SET_MODE: u16 = 176;
const SET_MODE: u16 = 11;

/// MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
const OUT_OF_RANGE: u8 = 2;
/// MAV_PARAM_ERROR_PERMISSION_DENIED
const PERMISSION_DENIED: u8 = 3;

const WARNING: u8 = 4;

const HOLD: u32 = 4;

/// A computer on the rover, with its system id.
const COMPANION: [u8; 2] = [1, 191];

const STANDBY_STATE: u8 = 3;
const ACTIVE_STATE: u8 = 4;
const CRITICAL_STATE: u8 = 5;
const EMERGENCY_STATE: u8 = 6;

const CRT_VOLT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::CrtVolt);
const VOLT_MULT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::VoltMult);
const ARM_VOLT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::ArmVolt);

/// A rover on a fast link.
struct Rover(Desk);

impl Rover {
    /// A rover with a pack of 11.1 V, without a slew rate limit.
    fn new() -> Self {
        let mut desk = Desk::with_packs(&[healthy(11.1)]);
        desk.set(VehicleParameter::MotSlewrate, 0.0);
        Self(desk)
    }

    fn armed_in(mode: f32) -> Self {
        let mut rover = Self::new();
        rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
        rover.assert_ack(&do_set_mode(mode), DO_SET_MODE, ACCEPTED);
        rover
    }

    /// Armed in MANUAL, with centred sticks of MANUAL_CONTROL.
    fn driven() -> Self {
        let mut rover = Self::armed_in(0.0);
        rover.deliver(&manual_control(1, 0, 0));
        rover
    }

    fn with(mut self, id: impl Into<ParameterId>, value: f32) -> Self {
        self.0.set(id, value);
        self
    }

    /// Delivers requests and returns the event of the last one.
    fn deliver(&mut self, requests: &[u8]) -> Event {
        let events = self.0.receive_in_chunks(requests, requests.len().max(1));
        events.last().copied().unwrap_or(Event::Ignored)
    }

    /// Delivers a request, asserts its acknowledgement, and returns the preceding texts with their severities.
    fn ask(&mut self, request: &[u8], command: u16, result: u8) -> Vec<(u8, String)> {
        self.deliver(request);
        let mut answers = self.0.sent();
        let ack = answers.pop().expect("an answer");
        assert_eq!(ack.message_id, COMMAND_ACK);
        assert_eq!((ack.u16(0), ack.u8(2)), (command, result));
        joined(&answers)
    }

    fn assert_ack(&mut self, request: &[u8], command: u16, result: u8) {
        assert_eq!(self.ask(request, command, result), []);
    }

    /// Asserts that arming fails for this reason alone.
    #[track_caller]
    fn assert_refused(&mut self, reason: &str) {
        let texts = self.ask(&arm(), ARM_DISARM, FAILED);
        assert_eq!(texts, [(CRITICAL, reason.to_string())]);
    }

    /// The failures that the checks before arming find.
    fn prearm_failures(&mut self) -> Vec<String> {
        let request = command_long(RUN_PREARM_CHECKS, 0.0);
        let texts = self.ask(&request, RUN_PREARM_CHECKS, ACCEPTED);
        texts.into_iter().map(|(_, text)| text).collect()
    }

    /// Updates the vehicle every 20 ms and returns the texts of what it does.
    fn wait(&mut self, us: u64) -> Vec<String> {
        let until_us = self.0.now_us + us;
        while self.0.now_us < until_us {
            self.0.now_us += 20_000;
            self.0.drive();
        }
        self.0.post_due(self.0.now_us);
        let mut texts = self.texts();
        // Greets the first station.
        texts.retain(|text| !text.starts_with("rover-battmon "));
        texts
    }

    /// The texts that wait to leave, with their severities.
    fn said(&mut self) -> Vec<(u8, String)> {
        let mut sent = self.0.sent();
        sent.retain(|frame| frame.message_id == STATUSTEXT);
        joined(&sent)
    }

    /// The texts that wait to leave.
    fn texts(&mut self) -> Vec<String> {
        self.said().into_iter().map(|(_, text)| text).collect()
    }

    /// Opens another link.
    fn open(&mut self, link: LinkKind) {
        self.0.connect(link);
        self.0.autopilot.open(&mut self.0.endpoint);
    }

    /// Samples a pack of this voltage for some seconds.
    fn sample(&mut self, voltage_v: f32, seconds: u64) {
        let pin_v = voltage_v / self.0.parameters().get(VOLT_MULT);
        self.sample_pin(Ok(conversions(pin_v)), seconds);
    }

    /// Samples a pack whose conversions fail for some seconds.
    fn lose_readings(&mut self, seconds: u64) {
        self.sample_pin(Err(ReadError::Conversion), seconds);
    }

    fn sample_pin(&mut self, reading: Result<Conversions, ReadError>, seconds: u64) {
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, reading);
        readings.set(AnalogPin::Gp27, Ok(conversions(0.0)));
        for _ in 0..seconds * 10 {
            self.0.now_us += 100_000;
            self.0.sample(readings);
            self.0.drive();
        }
    }

    /// Motor outputs after the next update.
    fn drives(&mut self) -> SideDrives {
        assert_eq!(self.wait(20_000), [""; 0]);
        self.outputs()
    }

    /// Motor outputs now.
    fn outputs(&self) -> SideDrives {
        self.0.vehicle().drives()
    }

    /// Whether the next SYS_STATUS reports that the arming checks pass.
    fn is_ready(&mut self) -> bool {
        SysStatus(&self.built(Stream::SysStatus)).is_ready_to_arm()
    }

    /// Mode, flags and `system_status` of the next HEARTBEAT.
    fn heartbeat(&mut self) -> (u32, u8, u8) {
        let frame = self.built(Stream::Heartbeat);
        let heartbeat = Heartbeat(&frame);
        (
            heartbeat.custom_mode(),
            heartbeat.base_mode(),
            heartbeat.system_status(),
        )
    }

    /// The frame of a stream, as it is now.
    fn built(&self, stream: Stream) -> Frame {
        let mut framer = Framer::new();
        let message = stream.build(&self.0.autopilot.system_state(self.0.now()));
        let bytes: Vec<_> = framer.frame(&message, 1).iter().map(|byte| (0, *byte)).collect();
        frames(&bytes).remove(0)
    }
}

/// The texts, reassembled from their chunks.
fn joined(frames: &[Frame]) -> Vec<(u8, String)> {
    let mut texts: Vec<(u8, String)> = Vec::new();
    for frame in frames {
        assert_eq!(frame.message_id, STATUSTEXT);
        let text = frame.text(1, 50);
        match texts.last_mut().filter(|_| frame.u8(53) > 0) {
            Some((_, begun)) => begun.push_str(&text),
            None => texts.push((frame.u8(0), text)),
        }
    }
    texts
}

/// Outputs at these duties; 0 coasts.
fn turn(left: f32, right: f32) -> SideDrives {
    let [left, right] = [left, right].map(|share| match share {
        0.0 => MotorDrive::Coast,
        _ => MotorDrive::Turn(share),
    });
    SideDrives { left, right }
}

#[test]
fn a_ground_station_is_given_thresholds_to_copy_while_none_is_set() {
    let pack = |cell_count| BatteryState {
        cell_count,
        ..healthy(11.1)
    };
    let texts = |rover: &mut Rover| {
        rover.deliver(&param_request_list(VEHICLE));
        let mut texts = rover.texts();
        assert_eq!(texts.remove(0), format!("rover-battmon {}", firmware_version()));
        texts
    };
    let mut rover = Rover::new();
    rover.0.set_batteries(&[pack(None)]);
    let off = "Battery failsafes are off: set BATT_LOW_VOLT";
    assert_eq!(texts(&mut rover), [off], "unknown cells");
    rover.0.set_batteries(&[pack(Some(3))]);
    assert_eq!(
        texts(&mut rover),
        [off, "Set BATT_LOW_VOLT 10.50, BATT_CRT_VOLT 10.20"]
    );
    for (name, value) in [("BATT_LOW_VOLT", 10.5), ("BATT_CRT_VOLT", 10.2)] {
        rover.deliver(&param_set(name, value));
    }
    rover.0.sent();
    assert_eq!(texts(&mut rover), [""; 0]);
}

#[test]
fn cells_that_were_counted_come_with_thresholds_to_copy() {
    let mut rover = Rover(Desk::starting(Start::default()));
    rover.sample(11.1, 4);
    assert_eq!(
        rover.wait(0),
        [
            "Battery 1 has 3 cells (set BATT_CELLS to be sure)",
            "Set BATT_LOW_VOLT 10.50, BATT_CRT_VOLT 10.20"
        ]
    );
}

#[test]
// Requirement: PX-4
fn failsafes_that_are_off_name_the_parameter_that_is_missing() {
    let timer = BatteryParameter::LowTimer.of(Pack::First);
    let second = |parameter: BatteryParameter| parameter.of(Pack::Second);
    let texts = |rover: &mut Rover| {
        rover.deliver(&param_request_list(VEHICLE));
        let mut texts = rover.texts();
        texts.retain(|text| text.contains("failsafes"));
        texts
    };
    let mut untimed = Rover::new().with(CRT_VOLT, 10.2).with(timer, 0.0);
    let no_timer = "Battery failsafes are off: set BATT_LOW_TIMER";
    assert_eq!(texts(&mut untimed), [no_timer]);
    let mut second_untimed = Rover::new()
        .with(second(BatteryParameter::LowVolt), 10.5)
        .with(second(BatteryParameter::LowTimer), 0.0);
    second_untimed.0.set_batteries(&[healthy(11.1), healthy(11.1)]);
    let second_has_no_timer = "Battery failsafes are off: set BATT2_LOW_TIMER";
    assert_eq!(texts(&mut second_untimed), [second_has_no_timer]);
    let mut by_charge = second_untimed.with(second(BatteryParameter::LowMah), 500.0);
    let no_capacity = "Battery failsafes are off: set BATT2_CAPACITY";
    assert_eq!(texts(&mut by_charge), [no_capacity]);
    let with_capacity = BatteryState {
        capacity: Some(Amount::Mah(3300.0)),
        ..healthy(11.1)
    };
    by_charge.0.set_batteries(&[healthy(11.1), with_capacity]);
    assert_eq!(texts(&mut by_charge), [""; 0]);
    // Until the restart the first is monitored, whatever is set.
    let mut first_is_switched_off = Rover::new().with(BatteryParameter::Monitor.of(Pack::First), 0.0);
    let of_first = "Battery failsafes are off: set BATT_LOW_VOLT";
    assert_eq!(texts(&mut first_is_switched_off), [of_first]);
    let mut only_second = Rover::new();
    only_second
        .0
        .set_batteries(&[BatteryState::disabled(), healthy(11.1)]);
    let no_threshold = "Battery failsafes are off: set BATT2_LOW_VOLT";
    assert_eq!(texts(&mut only_second), [no_threshold]);
}

#[test]
// Requirement: R-15
fn a_link_that_opens_announces_that_logging_wears_the_flash_unless_the_log_is_off() {
    const WEARS: &str = "Logging wears out this flash chip: set LOG_BITMASK 0";
    for (flash_wear, bitmask, is_announced) in [
        (RegisterWear::EachPage, 520.0, true),
        (RegisterWear::EachPage, 0.0, false),
        (RegisterWear::None, 520.0, false),
    ] {
        let start = Start {
            flash_wear,
            ..Start::default()
        };
        let mut rover = Rover(Desk::starting(start)).with(VehicleParameter::LogBitmask, bitmask);
        rover.0.autopilot.open(&mut rover.0.endpoint);
        let texts = rover.texts();
        let announced = texts.iter().any(|text| text == WEARS);
        assert_eq!(announced, is_announced, "{flash_wear:?} {bitmask}: {texts:?}");
    }
}

#[test]
// Requirement: AP-17
fn every_station_that_asks_learns_why_a_pack_is_unhealthy() {
    let volt_pin = BatteryParameter::VoltPin.of(Pack::First);
    let start = Start::with_parameters(Parameters::defaults());
    let mut rover = Rover(Desk::starting(start)).with(volt_pin, -1.0);
    rover.sample(11.1, 1);
    for link in [LinkKind::Radio, LinkKind::Direct] {
        rover.0.connect(link);
        let failures = rover.prearm_failures();
        assert_eq!(failures, ["PreArm: Battery 1 unhealthy: no pin set"]);
        rover.assert_refused("Arm: Battery 1 unhealthy: no pin set");
    }
    let mut rover = rover.with(volt_pin, 26.0);
    rover.sample(11.1, 1);
    assert_eq!(rover.prearm_failures(), [""; 0]);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    rover.lose_readings(6);
    rover.deliver(&disarm());
    rover.0.sent();
    let lost = "PreArm: Battery 1 unhealthy: conversion failed";
    assert_eq!(rover.prearm_failures(), [lost]);
    // Latched for some seconds more, by a pack that is read.
    rover.sample(11.1, 1);
    assert_eq!(rover.prearm_failures(), ["PreArm: Battery 1 unhealthy"]);
    rover.sample(11.1, 5);
    assert_eq!(rover.prearm_failures(), [""; 0]);
}

/// A board whose motor drivers stand the default voltage, with this monitor of its pack.
fn with_drivers(monitor: f32) -> Rover {
    let start = start_with(&[("BATT_MONITOR", monitor), ("BATT_CURR_PIN", 27.0)]);
    Rover(Desk::with_own_drivers(start))
}

const DRIVER_LIMIT: VehicleParameter = VehicleParameter::MotDrvVolt;

impl Rover {
    #[track_caller]
    fn assert_too_high_for_its_drivers(&mut self) {
        self.assert_refused("Arm: Battery 1 voltage above MOT_DRV_VOLT");
        let failures = self.prearm_failures();
        assert_eq!(failures[0], "PreArm: Battery 1 voltage above MOT_DRV_VOLT");
        assert!(!self.is_ready());
    }

    #[track_caller]
    fn assert_arms(&mut self) {
        assert!(self.is_ready());
        self.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
        self.deliver(&disarm());
        self.0.sent();
    }
}

#[test]
fn a_pack_above_what_the_motor_drivers_stand_does_not_arm() {
    // On the board's divider: voltage, voltage and current, synthetic current.
    for monitor in [3.0, 4.0, 25.0] {
        let mut rover = with_drivers(monitor);
        for voltage_v in [11.1, 12.6] {
            rover.sample(voltage_v, 2);
            rover.assert_too_high_for_its_drivers();
        }
        // The voltage that is measured now counts, not what the pack was.
        rover.sample(10.5, 2);
        rover.assert_arms();
    }
}

#[test]
fn a_divider_at_full_scale_is_above_what_the_drivers_stand_at_once() {
    let full_scale = Ok(Conversions::of(4095));
    let mut rover = with_drivers(3.0);
    rover.sample_pin(full_scale, 2);
    rover.assert_too_high_for_its_drivers();
    // In a single tick, while the last voltage still counts as good.
    let mut rover = with_drivers(3.0);
    rover.sample(8.0, 2);
    let mut readings = AnalogReadings::NONE;
    readings.set(AnalogPin::Gp26, full_scale);
    rover.0.now_us += 100_000;
    rover.0.sample(readings);
    rover.assert_refused("Arm: Battery 1 voltage above MOT_DRV_VOLT");
    // The scale ends at 13.04 V: above it nothing is known of drivers that stand more.
    for limit_v in [0.0, 13.1] {
        let mut rover = with_drivers(3.0).with(DRIVER_LIMIT, limit_v);
        rover.sample_pin(full_scale, 2);
        let refused = rover.ask(&arm(), ARM_DISARM, FAILED);
        assert!(
            refused[0].1.starts_with("Arm: Battery 1 unhealthy: over range"),
            "{refused:?}"
        );
    }
}

#[test]
fn what_the_drivers_stand_is_checked_with_the_batteries_and_has_a_limit_that_can_be_off() {
    const STICKS: f32 = 64.0;
    const BATTERIES: f32 = 256.0;
    let mut rover = with_drivers(3.0);
    for (parameter, value, is_too_high) in [
        (DRIVER_LIMIT, 0.0, false),
        (DRIVER_LIMIT, 12.0, true),
        (VehicleParameter::ArmingCheck, STICKS, false),
        (VehicleParameter::ArmingCheck, BATTERIES, true),
    ] {
        rover = rover.with(parameter, value);
        rover.sample(12.6, 2);
        if is_too_high {
            rover.assert_too_high_for_its_drivers();
        } else {
            rover.assert_arms();
        }
    }
    // As any check: forced arming is the owner's decision.
    rover.assert_ack(&arm_by_force(), ARM_DISARM, ACCEPTED);
}

/// Low below 10.5 V, critical below 9.5 V, each after a second.
const THRESHOLDS: [(&str, f32); 3] = [
    ("BATT_LOW_TIMER", 1.0),
    ("BATT_LOW_VOLT", 10.5),
    ("BATT_CRT_VOLT", 9.5),
];

fn with_thresholds() -> Rover {
    Rover(Desk::starting(start_with(&THRESHOLDS)))
}

#[test]
// Requirement: AP-18
fn a_link_that_opens_while_a_level_is_latched_announces_it_once() {
    let levels = |rover: &mut Rover| {
        rover.0.post_due(rover.0.now_us);
        let mut texts = rover.said();
        for (_, text) in &mut texts {
            *text = text.split(' ').take(4).collect::<Vec<_>>().join(" ");
        }
        texts.retain(|(_, text)| text.contains(" is "));
        texts
    };
    let mut rover = with_thresholds();
    rover.sample(11.1, 2);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    rover.open(LinkKind::Radio);
    rover.sample(10.0, 2);
    let low = [(WARNING, "Battery 1 is low".to_string())];
    assert_eq!(levels(&mut rover), low, "open before");

    rover.open(LinkKind::Direct);
    assert_eq!(levels(&mut rover), low);
    rover.deliver(&param_request_list(VEHICLE));
    assert_eq!(levels(&mut rover), [], "once");
    rover.sample(9.0, 2);
    let critical = [(CRITICAL, "Battery 1 is critical".to_string())];
    assert_eq!(levels(&mut rover), critical);

    rover.lose_readings(6);
    assert_eq!(
        levels(&mut rover),
        [(WARNING, "Battery 1 is missing,".to_string())]
    );
    rover.open(LinkKind::Radio);
    assert_eq!(levels(&mut rover), critical, "the level that is latched");
    rover.deliver(&command_long_2(BATTERY_RESET, 1.0, 100.0));
    rover.sample(11.1, 1);
    rover.open(LinkKind::Direct);
    assert_eq!(levels(&mut rover), []);
}

#[test]
// Requirement: AP-18
fn a_station_that_was_away_when_a_level_was_latched_learns_of_it_once() {
    let mut rover = with_thresholds();
    rover.0.autopilot.open(&mut rover.0.endpoint);
    rover.sample(11.1, 2);
    rover.deliver(&heartbeat(GCS));
    rover.wait(20_000);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    let levels = |rover: &mut Rover| {
        let texts = rover.wait(20_000);
        let levels = texts.iter().filter(|text| text.contains("Battery 1 is low"));
        levels.count()
    };
    rover.sample(10.0, 29);
    assert_eq!(levels(&mut rover), 1, "when it was latched");
    // It was heard 29 s ago.
    rover.deliver(&heartbeat(GCS));
    assert_eq!(levels(&mut rover), 0);
    rover.sample(10.0, 31);
    rover.deliver(&heartbeat(GCS));
    assert_eq!(levels(&mut rover), 1, "it was away");
    rover.sample(10.0, 1);
    rover.deliver(&heartbeat(GCS));
    assert_eq!(levels(&mut rover), 0, "once");
}

#[test]
fn command_long_and_command_int_arm_and_disarm() {
    for request in [arm(), command_int_2(ARM_DISARM, 1.0, 0.0)] {
        let mut rover = Rover::new();
        assert_eq!(rover.heartbeat(), (HOLD, 1, STANDBY_STATE));
        rover.assert_ack(&request, ARM_DISARM, ACCEPTED);
        assert_eq!(rover.heartbeat(), (HOLD, 1 | 128, STANDBY_STATE));
        assert_eq!(rover.drives(), SideDrives::BRAKE);
        rover.assert_ack(&request, ARM_DISARM, ACCEPTED);
        rover.assert_ack(&disarm(), ARM_DISARM, ACCEPTED);
        assert_eq!(rover.heartbeat(), (HOLD, 1, STANDBY_STATE));
        assert_eq!(rover.drives(), SideDrives::COAST);
    }
    for param1 in [2.0, -1.0, 0.5, f32::NAN] {
        Rover::new().assert_ack(&command_long(ARM_DISARM, param1), ARM_DISARM, DENIED);
    }
}

#[test]
// Requirement: AP-17
fn unfit_pack_prevents_arming_unless_forced() {
    let unfit = || Rover::new().with(ARM_VOLT, 11.2).with(LOW_VOLT, 11.15);
    let mut rover = unfit();
    rover.assert_refused("Arm: Battery 1 below minimum arming voltage");
    assert_eq!(rover.deliver(&arm()), Event::CommandRefused(ARM_DISARM));
    assert_eq!(rover.heartbeat(), (HOLD, 1, STANDBY_STATE));
    for force in [21196.0, 2989.0] {
        unfit().assert_ack(&command_long_2(ARM_DISARM, 1.0, force), ARM_DISARM, ACCEPTED);
    }
    for no_force in [1.0, 21195.0, f32::NAN] {
        unfit().ask(&command_long_2(ARM_DISARM, 1.0, no_force), ARM_DISARM, FAILED);
    }
    // Disarming is always accepted.
    unfit().assert_ack(&disarm(), ARM_DISARM, ACCEPTED);
}

#[test]
fn prearm_check_reports_all_failures_of_all_packs() {
    let mut rover = Rover::new()
        .with(LOW_VOLT, 11.2)
        .with(CRT_VOLT, 11.2)
        .with(BatteryParameter::ArmVolt.of(Pack::Third), 12.0);
    let critical = BatteryState {
        failsafe: FailsafeLevel::Critical,
        ..healthy(12.6)
    };
    rover
        .0
        .set_batteries(&[healthy(11.1), BatteryState::disabled(), critical]);
    let checks = command_long(RUN_PREARM_CHECKS, f32::NAN);
    let texts = rover.ask(&checks, RUN_PREARM_CHECKS, ACCEPTED);
    let expected = [
        "PreArm: Battery 1 critical voltage failsafe",
        "PreArm: Battery 1 low voltage failsafe",
        "PreArm: Battery 1 voltage failsafe critical >= low",
        "PreArm: Battery 3 critical voltage failsafe",
    ];
    assert_eq!(texts, expected.map(|text| (CRITICAL, text.to_string())));
    assert_eq!(rover.deliver(&checks), Event::Answered, "nothing is driven");
    assert_eq!(rover.heartbeat(), (HOLD, 1, STANDBY_STATE));

    let mut armed = Rover::armed_in(4.0);
    armed.assert_ack(&checks, RUN_PREARM_CHECKS, TEMPORARILY_REJECTED);
}

#[test]
fn arming_names_a_curve_that_falls_until_all_of_its_points_rise() {
    let [curve_10, curve_50] =
        [BatteryParameter::Curve10, BatteryParameter::Curve50].map(|point| point.of(Pack::First));
    let mut rover = Rover::new().with(curve_50, 3.7).with(curve_10, 3.7);
    rover.0.set_batteries(&[healthy(12.0)]);
    let checks = command_long(RUN_PREARM_CHECKS, f32::NAN);
    let texts = rover.ask(&checks, RUN_PREARM_CHECKS, ACCEPTED);
    let expected = "PreArm: Battery 1 curve does not rise, or fit its cells";
    assert_eq!(texts, [(CRITICAL, expected.to_string())]);
    let mut rover = rover.with(curve_10, 3.5);
    assert_eq!(rover.ask(&checks, RUN_PREARM_CHECKS, ACCEPTED), []);
}

/// The readiness to arm that SYS_STATUS reports is the answer that an attempt gets.
#[test]
// Requirement: AP-17
fn sys_status_is_ready_to_arm_when_an_attempt_succeeds() {
    let checking = |checks| vec![(ARM_VOLT, 11.2), (VehicleParameter::ArmingCheck.into(), checks)];
    for (parameters, request, (voltage_v, seconds), result) in [
        (vec![], vec![], (11.1, 0), ACCEPTED),
        (vec![(ARM_VOLT, 11.2)], vec![], (11.1, 0), FAILED),
        (vec![(LOW_VOLT, 11.2)], vec![], (11.1, 0), FAILED),
        (checking(0.0), vec![], (11.1, 0), ACCEPTED),
        (checking(1.0), vec![], (11.1, 0), FAILED),
        (checking(256.0), vec![], (11.1, 0), FAILED),
        (checking(257.0), vec![], (11.1, 0), FAILED),
        (vec![], manual_control(1, 0, 1000), (11.1, 0), FAILED),
        (vec![], reboot(), (11.1, 0), FAILED),
        (vec![], vec![], (0.3, 2), FAILED),
        (vec![], arm(), (11.1, 0), ACCEPTED),
    ] {
        let mut rover = Rover(Desk::starting(Start::with_parameters(Parameters::defaults())));
        assert!(!rover.is_ready(), "not checked yet");
        rover.sample(11.1, 2);
        assert!(rover.is_ready());
        for (id, value) in &parameters {
            rover.0.set(*id, *value);
        }
        rover.deliver(&request);
        rover.sample(voltage_v, seconds);
        rover.0.sent();
        rover.sample(voltage_v, 1);
        let is_ready = result == ACCEPTED;
        assert_eq!(
            rover.is_ready(),
            is_ready,
            "{parameters:?} {request:?} {voltage_v} V"
        );
        rover.ask(&arm(), ARM_DISARM, result);
    }
}

#[test]
fn prearm_check_is_acknowledged_despite_many_failures() {
    use BatteryParameter::{ArmVolt, CrtVolt, LowVolt};
    let mut rover = Rover::new();
    rover.0.set_batteries(&[healthy(5.0); 9]);
    for id in Pack::ALL
        .into_iter()
        .flat_map(|pack| [ArmVolt, LowVolt, CrtVolt].map(|id| id.of(pack)))
    {
        rover.0.set(id, 10.0);
    }
    // The queue holds fifteen texts beside the acknowledgement.
    assert_eq!(rover.prearm_failures().len(), 15);
    assert_eq!(rover.0.statistics().dropped, 9 * 4 - 15);
}

#[test]
fn modes_are_set_by_number_and_unknown_ones_fail() {
    let mut rover = Rover::new();
    rover.assert_ack(&do_set_mode(0.0), DO_SET_MODE, ACCEPTED);
    assert_eq!(rover.heartbeat(), (MANUAL, 1 | 64, STANDBY_STATE));
    rover.assert_ack(&set_mode(1, 1, HOLD), SET_MODE, ACCEPTED);
    assert_eq!(rover.heartbeat(), (HOLD, 1, STANDBY_STATE));
    rover.assert_ack(&set_mode(0, 0x81, MANUAL), SET_MODE, ACCEPTED);
    let texts = rover.ask(&do_set_mode(10.0), DO_SET_MODE, FAILED);
    assert_eq!(texts, [(WARNING, "No such mode 10: Manual or Hold".into())]);
    let texts = rover.ask(&set_mode(1, 1, u32::MAX), SET_MODE, FAILED);
    assert_eq!(
        texts,
        [(WARNING, "No such mode 4294967295: Manual or Hold".into())]
    );
    rover.assert_ack(&set_mode(1, 0x80, HOLD), SET_MODE, DENIED);
    rover.assert_ack(&command_long_2(DO_SET_MODE, 0.0, 4.0), DO_SET_MODE, DENIED);
    for no_base_mode in [257.0, 1.5, -1.0, f32::INFINITY, f32::NAN] {
        let request = command_long_2(DO_SET_MODE, no_base_mode, 4.0);
        rover.assert_ack(&request, DO_SET_MODE, DENIED);
    }
    for mode in [f32::NAN, -1.0, 0.5, 1e20] {
        rover.assert_ack(&do_set_mode(mode), DO_SET_MODE, DENIED);
    }
    assert_eq!(rover.deliver(&set_mode(2, 1, HOLD)), Event::Ignored);
    assert_eq!(rover.heartbeat().0, MANUAL);
}

#[test]
fn a_motor_test_is_refused_with_what_to_use_instead() {
    const DO_MOTOR_TEST: u16 = 209;
    let refused = Rover::new().ask(&command_long(DO_MOTOR_TEST, 1.0), DO_MOTOR_TEST, UNSUPPORTED);
    assert_eq!(refused, [(WARNING, "No motor test: use board-check".into())]);
}

#[test]
fn deflected_stick_prevents_arming() {
    for (steering, throttle, text) in [
        (0, 1000, "Arm: Throttle (RC3) is not neutral"),
        (0, -51, "Arm: Throttle (RC3) is not neutral"),
        (-300, 0, "Arm: Steering (RC1) is not neutral"),
    ] {
        let mut rover = Rover::new();
        rover.deliver(&manual_control(1, steering, throttle));
        rover.assert_refused(text);
        // Centred or timed out: arming succeeds.
        rover.deliver(&manual_control(1, 50, -50));
        rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
        let mut rover = Rover::new();
        rover.deliver(&manual_control(1, steering, throttle));
        rover.wait(1_600_000);
        rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    }
}

#[test]
fn the_throttle_is_on_the_channel_that_is_set() {
    let mut rover = Rover::new().with(StickParameter::RcmapThrottle, 5.0);
    rover.wait(20_000);
    // The fifth channel is near its end.
    rover.deliver(&rc_override(VEHICLE, 1500, 1500));
    rover.assert_refused("Arm: Throttle (RC5) is not neutral");
}

#[test]
fn time_outs_of_the_driver_are_lowered_but_not_raised_while_armed() {
    let mut rover = Rover::armed_in(0.0);
    for (name, raised, lowered) in [("FS_TIMEOUT", 2.0, 1.0), ("FS_GCS_TIMEOUT", 6.0, 3.0)] {
        let answers = rover.0.ask(&param_set(name, raised));
        assert_eq!(
            of_message(&answers, PARAM_ERROR)[0].u8(20),
            PERMISSION_DENIED,
            "{name}"
        );
        let text = format!("{name} refused: not raised while armed");
        assert_eq!(rover.wait(20_000), [text]);
        let answers = rover.0.ask(&param_set(name, lowered));
        assert_eq!(answers.len(), 1, "{answers:?}");
        assert_eq!(ParamValue(&answers[0]).value(), lowered);
    }
}

#[test]
fn a_point_of_a_curve_that_no_cell_of_the_chemistry_has_is_refused_by_name() {
    let mut rover = Rover::new();
    for (value, text) in [
        (1.3, "BATT_CURVE_50 refused: no such cell by its CHEM"),
        (5.0, "BATT_CURVE_50 refused: valid 0, 0.8 to 4.35"),
    ] {
        let answers = rover.0.ask(&param_set("BATT_CURVE_50", value));
        assert_eq!(
            of_message(&answers, PARAM_ERROR)[0].u8(20),
            OUT_OF_RANGE,
            "{value}"
        );
        assert_eq!(rover.wait(20_000), [text]);
        let point = BatteryParameter::Curve50.of(Pack::First);
        assert_eq!(rover.0.autopilot.parameters().get(point), 0.0);
    }
}

#[test]
fn long_time_outs_are_announced_at_each_arming() {
    let mut rover = Rover::new()
        .with(VehicleParameter::FsTimeout, 5.5)
        .with(VehicleParameter::FsGcsTimeout, 10.0);
    for _ in 0..2 {
        rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
        let texts = rover.wait(20_000);
        assert_eq!(
            texts,
            ["Armed with FS_TIMEOUT 5.50: drives on for long without a driver"]
        );
        rover.assert_ack(&disarm(), ARM_DISARM, ACCEPTED);
        rover.wait(20_000);
    }
}

#[test]
// Requirement: L-3
fn requests_delayed_beyond_the_timeout_are_refused() {
    let mut rover = Rover::armed_in(0.0);
    rover.wait(2_000_000);
    rover.0.waited_us = 1_500_001;
    for request in [manual_control(1, 0, 1000), rc_override(VEHICLE, 1500, 2000)] {
        assert_eq!(rover.deliver(&request), Event::ControlTooLate);
        assert_eq!(rover.drives(), SideDrives::COAST);
    }
    let refused = [(WARNING, "Command waited for too long: refused".to_string())];
    assert_eq!(rover.ask(&do_set_mode(0.0), DO_SET_MODE, FAILED), refused);
    // Requests that stop the rover are accepted at any delay.
    rover.assert_ack(&do_set_mode(4.0), DO_SET_MODE, ACCEPTED);
    rover.assert_ack(&disarm(), ARM_DISARM, ACCEPTED);
    assert_eq!(rover.ask(&arm(), ARM_DISARM, FAILED), refused);
    rover.0.waited_us = 1_500_000;
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
}

#[test]
fn restart_and_parameter_reset_are_refused_while_armed() {
    for (request, number) in [
        (reboot(), 246),
        (command_int(246, 1.0), 246),
        (reboot_to_boot_loader(), 246),
        (provoke_fault(), 246),
        (command_int(246, 3.0), 246),
        (command_long(245, 2.0), 245),
        (command_int(245, 2.0), 245),
    ] {
        let mut rover = Rover::driven();
        rover.deliver(&manual_control(1, 0, 1000));
        let texts = rover.ask(&request, number, FAILED);
        assert_eq!(texts, [(WARNING, "Not while armed: disarm first".to_string())]);
        assert_eq!(rover.deliver(&request), Event::CommandRefused(number));
        rover.0.sent();
        assert_eq!(rover.drives(), turn(1.0, 1.0), "still driving");
        rover.assert_ack(&disarm(), ARM_DISARM, ACCEPTED);
        assert!(matches!(rover.deliver(&request), Event::Command(_)));
    }
}

#[test]
// Requirement: L-4
fn arming_is_refused_before_a_restart() {
    for request in [reboot(), reboot_to_boot_loader(), provoke_fault()] {
        let mut rover = Rover::new();
        rover.deliver(&request);
        rover.0.sent();
        for force in [0.0, FORCED] {
            let texts = rover.ask(&command_long_2(ARM_DISARM, 1.0, force), ARM_DISARM, FAILED);
            assert_eq!(texts, [(CRITICAL, "Arm: restarting".to_string())]);
        }
    }
}

#[test]
// Requirement: L-2
fn overrides_of_other_channels_are_no_heartbeat() {
    let mut rover = Rover::armed_in(0.0);
    rover.deliver(&heartbeat(GCS));
    let mut texts = Vec::new();
    for _ in 0..60 {
        rover.deliver(&rc_override(VEHICLE, 65535, 65535));
        texts.extend(rover.wait(100_000));
    }
    assert_eq!(texts, ["GCS Failsafe: Hold"]);
}

#[test]
// Requirement: OWN-2
fn controls_time_out_after_fs_timeout() {
    for timeout_s in [1.0, 1.5, 10.0] {
        let mut rover = Rover::driven();
        rover.drives();
        rover = rover.with(VehicleParameter::FsTimeout, timeout_s);
        rover.deliver(&manual_control(1, 0, 1000));
        assert_eq!(rover.wait((timeout_s * 1e6) as u64), [""; 0]);
        assert_eq!(rover.outputs(), turn(1.0, 1.0));
        assert_eq!(rover.wait(20_000), ["Radio Failsafe: Hold"]);
        assert_eq!(rover.outputs(), SideDrives::BRAKE);
        assert_eq!(rover.heartbeat(), (HOLD, 1 | 128, CRITICAL_STATE));
        assert_eq!(rover.wait(30_000_000), [""; 0], "announced once");

        let texts = rover.ask(&do_set_mode(0.0), DO_SET_MODE, FAILED);
        assert_eq!(texts, [(WARNING, "Failsafe active: mode change denied".into())]);
        rover.deliver(&manual_control(1, 0, 0));
        assert_eq!(rover.heartbeat(), (HOLD, 1 | 128, STANDBY_STATE));
        rover.assert_ack(&do_set_mode(0.0), DO_SET_MODE, ACCEPTED);
        assert_eq!(rover.heartbeat(), (MANUAL, 1 | 64 | 128, ACTIVE_STATE));
    }
}

#[test]
// Requirement: L-2
fn only_ground_station_heartbeats_time_out() {
    let mut rover = Rover::armed_in(0.0);
    assert_eq!(rover.deliver(&heartbeat(ONBOARD_CONTROLLER)), Event::Ignored);
    assert_eq!(rover.wait(5_000_000), [""; 0]);
    for expected in [Event::GroundStationIntroduced]
        .into_iter()
        .chain([Event::GroundStationHeard; 4])
    {
        assert_eq!(rover.deliver(&heartbeat(GCS)), expected);
        // Also after a few lost ones.
        assert_eq!(rover.wait(4_000_000), [""; 0]);
    }
    rover.deliver(&heartbeat(ONBOARD_CONTROLLER));
    assert_eq!(rover.deliver(&heartbeat_from(COMPANION, GCS)), Event::Ignored);
    assert_eq!(rover.wait(1_200_000), ["GCS Failsafe: Hold"]);
    rover.deliver(&heartbeat_from(COMPANION, GCS));
    assert_eq!(rover.heartbeat(), (HOLD, 1 | 128, CRITICAL_STATE));
    rover.deliver(&heartbeat(GCS));
    assert_eq!(rover.heartbeat(), (HOLD, 1 | 128, STANDBY_STATE));
}

/// Two packs at the same pin, which trip at different voltages.
fn two_packs(of_second: &[(&str, f32)]) -> Rover {
    let both = [
        ("BATT_CELLS", 3.0),
        ("BATT_LOW_TIMER", 1.0),
        ("BATT_CRT_VOLT", 9.5),
        ("BATT_FS_CRT_ACT", 5.0),
        ("BATT2_MONITOR", 3.0),
        ("BATT2_VOLT_PIN", 26.0),
        ("BATT2_CELLS", 3.0),
        ("BATT2_LOW_TIMER", 1.0),
    ];
    let mut rover = Rover(Desk::starting(start_with(&[&both[..], of_second].concat())));
    rover.sample(11.1, 2);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    rover.sample(9.3, 3);
    rover.sample(11.1, 2);
    rover.wait(20_000);
    assert_eq!(rover.heartbeat(), (HOLD, 1, EMERGENCY_STATE));
    rover
}

#[test]
// Requirement: AP-16, L-5
fn a_termination_ends_with_the_reset_of_its_pack_before_the_command_is_acknowledged() {
    let reset = |rover: &mut Rover, mask: f32| {
        let request = command_long_2(BATTERY_RESET, mask, 100.0);
        rover.assert_ack(&request, BATTERY_RESET, ACCEPTED);
    };
    // The level of the second pack only warns: it goes on refusing, unless arming is forced.
    let low = [("BATT2_LOW_VOLT", 10.5)];
    let mut rover = two_packs(&low);
    reset(&mut rover, 2.0);
    rover.assert_refused("Arm: Terminated: reset the battery or restart");
    let mut rover = two_packs(&low);
    reset(&mut rover, 1.0);
    assert_eq!(rover.heartbeat(), (HOLD, 1, STANDBY_STATE));
    rover.assert_refused("Arm: Battery 2 low voltage failsafe");
    rover.assert_ack(&arm_by_force(), ARM_DISARM, ACCEPTED);
    let mut rover = two_packs(&low);
    reset(&mut rover, 3.0);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    // Both have terminated, in the same tick.
    let critical = [("BATT2_CRT_VOLT", 9.5), ("BATT2_FS_CRT_ACT", 5.0)];
    for first_reset in [1.0, 2.0] {
        let mut rover = two_packs(&critical);
        reset(&mut rover, first_reset);
        for _ in 0..2 {
            let texts = rover.ask(&arm_by_force(), ARM_DISARM, FAILED);
            assert_eq!(texts[0].1, "Arm: Terminated: reset the battery or restart");
            rover.sample(11.1, 1);
        }
        reset(&mut rover, 3.0 - first_reset);
        rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    }
}

#[test]
// Requirement: AP-16
fn a_charge_that_is_set_counts_in_the_next_request() {
    let start = start_with(&[("BATT_CELLS", 3.0), ("BATT_ARM_MAH", 500.0)]);
    let mut rover = Rover(Desk::starting(start));
    rover.sample(11.1, 10);
    for (percent, refused) in [
        (100.0, None),
        (10.0, Some("Arm: Battery 1 below minimum arming capacity")),
        (4.0, Some("Arm: Battery 1 is nearly empty")),
        (0.0, Some("Arm: Battery 1 is nearly empty")),
        (60.0, None),
    ] {
        let request = command_long_2(BATTERY_RESET, 1.0, percent);
        rover.assert_ack(&request, BATTERY_RESET, ACCEPTED);
        match refused {
            Some(reason) => rover.assert_refused(reason),
            None => rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED),
        }
        rover.assert_ack(&disarm(), ARM_DISARM, ACCEPTED);
    }
}

#[test]
// Requirement: AP-19
fn an_action_that_is_chosen_after_its_level_says_that_it_comes_too_late() {
    const LOW: &str = "Battery 1 is low already: acts next time, choose Hold";
    let mut rover = Rover(Desk::starting(start_with(&THRESHOLDS)));
    rover.0.autopilot.open(&mut rover.0.endpoint);
    let set = |rover: &mut Rover, name, value| {
        rover.deliver(&param_set(name, value));
        let mut texts = rover.wait(20_000);
        texts.retain(|text| text.contains("already"));
        texts
    };
    rover.sample(11.1, 2);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    rover.assert_ack(&do_set_mode(0.0), DO_SET_MODE, ACCEPTED);
    assert_eq!(
        set(&mut rover, "BATT_FS_LOW_ACT", 2.0),
        [""; 0],
        "not reached yet"
    );
    assert_eq!(set(&mut rover, "BATT_FS_LOW_ACT", 0.0), [""; 0]);
    rover.sample(10.0, 2);
    rover.wait(20_000);
    for (name, action, texts) in [
        ("BATT_FS_LOW_ACT", 2.0, &[LOW][..]),
        ("BATT_FS_LOW_ACT", 2.0, &[]),
        ("BATT_FS_LOW_ACT", 5.0, &[LOW]),
        ("BATT_FS_LOW_ACT", 0.0, &[]),
        ("BATT_FS_CRT_ACT", 2.0, &[]),
        ("BATT2_FS_LOW_ACT", 2.0, &[]),
        ("BATT_LOW_VOLT", 10.4, &[]),
    ] {
        assert_eq!(set(&mut rover, name, action), texts, "{name} {action}");
    }
    rover.assert_ack(&do_set_mode(HOLD as f32), DO_SET_MODE, ACCEPTED);
    assert_eq!(
        set(&mut rover, "BATT_FS_LOW_ACT", 1.0),
        [""; 0],
        "it holds already"
    );
    rover.assert_ack(&disarm(), ARM_DISARM, ACCEPTED);
    assert_eq!(set(&mut rover, "BATT_FS_LOW_ACT", 5.0), [""; 0]);
}

#[test]
// Requirement: L-2
fn components_of_the_vehicle_are_no_ground_stations() {
    // Alone they start no monitoring.
    let mut rover = Rover::armed_in(0.0);
    rover.deliver(&heartbeat_from(COMPANION, GCS));
    assert_eq!(rover.wait(6_000_000), [""; 0]);
    // Neither do their sticks stand for a station that was there. Those of another system do.
    for (system_id, announced) in [(COMPANION[0], &["GCS Failsafe: Hold"][..]), (77, &[])] {
        let mut rover = Rover::armed_in(0.0);
        rover.deliver(&heartbeat(GCS));
        let mut stick = manual_control(1, 0, 0);
        stick[5] = system_id;
        let mut texts = Vec::new();
        for _ in 0..60 {
            rover.deliver(&resealed(&stick));
            texts.extend(rover.wait(100_000));
        }
        assert_eq!(texts, announced, "{system_id}");
    }
}

#[test]
// Requirement: L-3
fn battery_hold_can_be_left_and_termination_can_not() {
    let actions = [("BATT_FS_LOW_ACT", 2.0), ("BATT_FS_CRT_ACT", 5.0)];
    let mut rover = Rover(Desk::starting(start_with(&[&THRESHOLDS[..], &actions].concat())));
    rover.sample(11.1, 2);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
    rover.assert_ack(&do_set_mode(0.0), DO_SET_MODE, ACCEPTED);
    rover.sample(10.0, 2);
    assert_eq!(rover.heartbeat(), (HOLD, 1 | 128, STANDBY_STATE));
    rover.wait(20_000);
    rover.assert_ack(&do_set_mode(0.0), DO_SET_MODE, ACCEPTED);
    assert_eq!(rover.heartbeat(), (MANUAL, 1 | 64 | 128, ACTIVE_STATE));

    rover.sample(9.0, 2);
    assert_eq!(rover.heartbeat(), (MANUAL, 1 | 64, EMERGENCY_STATE));
    rover.wait(20_000);
    rover.sample(11.1, 2);
    for force in [0.0, 21196.0] {
        let request = command_long_2(ARM_DISARM, 1.0, force);
        let texts = rover.ask(&request, ARM_DISARM, FAILED);
        assert!(texts.iter().all(|(severity, _)| *severity == CRITICAL));
        assert!(force == 0.0 || texts[0].1 == "Arm: Terminated: reset the battery or restart");
    }
    let failures = rover.prearm_failures();
    assert_eq!(failures[0], "PreArm: Terminated: reset the battery or restart");
    rover.assert_ack(
        &command_long_2(BATTERY_RESET, 1.0, 100.0),
        BATTERY_RESET,
        ACCEPTED,
    );
    rover.sample(11.1, 1);
    rover.assert_ack(&arm(), ARM_DISARM, ACCEPTED);
}
