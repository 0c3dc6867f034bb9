//! The power limit of a pack, which supplies the motors by the square of their duties.

use rover_battmon::battery::{BusError, Measurement};
use rover_battmon::mavlink::{Endpoint, LinkKind};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::VehicleParameter;
use rover_battmon::sensor::AnalogReadings;
use rover_battmon::vehicle::MotorDrive;
use support::commands::ACCEPTED;
use support::desk::{Desk, id_of, start_with};
use support::frames::{ParamValue, texts_of};
use support::monitor_types::INA2XX;
use support::requests::{VEHICLE_ID, arm, disarm, do_set_mode, manual_control, param_set};

const MANUAL: f32 = 0.0;

const PACK_V: f32 = 11.4;
const LIMIT_W: f32 = 20.0;

/// A rover whose pack is measured by a part on the bus.
struct Limited {
    desk: Desk,
    /// All motors at full duty.
    full_w: f32,
    is_connected: bool,
    /// Amperes that the sensor shows for one; 0 if it measures none.
    amperes: f32,
    /// Resistance of the pack.
    pack_ohm: f32,
    texts: Vec<String>,
}

impl Limited {
    /// Armed in MANUAL.
    fn new() -> Self {
        Self::with(|_| {})
    }

    /// Armed in MANUAL after this change.
    fn with(change: impl FnOnce(&mut Self)) -> Self {
        let start = start_with(&[
            ("BATT_MONITOR", INA2XX),
            ("BATT_CELLS", 3.0),
            ("BATT_WATT_MAX", LIMIT_W),
            ("BATT2_WATT_MAX", LIMIT_W),
        ]);
        let mut rover = Self {
            desk: Desk::starting(start),
            full_w: 52.0,
            is_connected: true,
            amperes: 1.0,
            pack_ohm: 0.0,
            texts: Vec::new(),
        };
        change(&mut rover);
        rover.steer_for(2, 0, 0);
        for request in [arm(), do_set_mode(MANUAL)] {
            assert_eq!(rover.desk.result_of(&request), ACCEPTED);
        }
        rover
    }

    fn drawn_w(&self) -> f32 {
        let drives = self.desk.vehicle().drives();
        let squared = |drive| match drive {
            MotorDrive::Turn(duty) => f32::powi(duty, 2),
            MotorDrive::Brake | MotorDrive::Coast => 0.0,
        };
        self.full_w * (squared(drives.left) + squared(drives.right)) / 2.0
    }

    /// A reading and a stick's position every 100 ms. Returns the power at each.
    fn steer_for(&mut self, seconds: usize, steering: i16, throttle: i16) -> Vec<f32> {
        let step = |_| {
            let stick = manual_control(VEHICLE_ID, steering, throttle);
            self.desk.receive_in_chunks(&stick, 64);
            for _ in 0..5 {
                self.desk.now_us += 20_000;
                self.desk.drive();
            }
            let drawn_w = self.drawn_w();
            let measured = Measurement {
                voltage_v: Some(PACK_V - self.pack_ohm * drawn_w / PACK_V),
                current_a: (self.amperes != 0.0).then_some(self.amperes * drawn_w / PACK_V),
                ..Measurement::default()
            };
            let reading = self.is_connected.then_some(measured);
            let reading = reading.ok_or(BusError::NoAnswer.into());
            let now = self.desk.now();
            self.desk.autopilot.add_bus_reading(Pack::First, reading, now);
            self.desk.sample(AnalogReadings::NONE);
            self.desk.post_due(self.desk.now_us);
            self.texts.extend(texts_of(&self.desk.sent()));
            drawn_w
        };
        (0..10 * seconds).map(step).collect()
    }

    /// Full power without a limit.
    fn assert_unlimited(&mut self, steering: i16, throttle: i16) {
        let unlimited = self.steer_for(2, steering, throttle);
        let most_w = unlimited.iter().copied().fold(0.0, f32::max);
        assert!(most_w > 1.5 * LIMIT_W, "{most_w} W");
    }

    /// Within five seconds the power is the limit, and stays so.
    fn assert_limited(&mut self, steering: i16, throttle: i16) {
        self.steer_for(5, steering, throttle);
        let limited = self.steer_for(5, steering, throttle);
        let is_limit = |power_w: &f32| (power_w / LIMIT_W - 1.0).abs() < 0.05;
        assert!(limited.iter().all(is_limit), "{limited:.1?}");
    }

    fn set_limit(&mut self, max_w: f32) {
        let answers = self.desk.ask(&param_set("BATT_WATT_MAX", max_w));
        assert_eq!(ParamValue(&answers[0]).value(), max_w);
    }

    /// The texts for a station whose link is opened now.
    fn seen_by_another(&mut self) -> Vec<String> {
        let none = Endpoint::new("another", LinkKind::Direct, 100_000, self.desk.now());
        let first = std::mem::replace(&mut self.desk.endpoint, none);
        self.desk.autopilot.open(&mut self.desk.endpoint);
        let mut texts = texts_of(&self.desk.sent());
        self.desk.autopilot.close(&self.desk.endpoint);
        self.desk.endpoint = first;
        texts.retain(|text| text.contains("limits the motors"));
        texts
    }

    fn announced(&self, text: &str) -> usize {
        let texts = self.texts.iter();
        texts.filter(|announced| announced.contains(text)).count()
    }
}

#[test]
// Requirement: AP-28
fn straight_ahead_a_pack_supplies_its_limit_and_all_again_when_the_load_falls() {
    let mut rover = Limited::new();
    rover.assert_unlimited(0, 1000);
    rover.assert_limited(0, 1000);
    assert_eq!(rover.announced("Battery 1 limits the motors: over 20W"), 1);
    // Downhill.
    rover.full_w = 15.0;
    let released = rover.steer_for(6, 0, 1000);
    assert_eq!(released.last(), Some(&15.0), "{released:.1?}");
    rover.full_w = 52.0;
    rover.assert_limited(0, 1000);
    assert_eq!(
        rover.announced("limits the motors"),
        1,
        "it was released for less than ten seconds"
    );
    assert_eq!(rover.announced("fault"), 0);
}

#[test]
// Requirement: AP-28
fn a_limit_and_its_end_are_announced_also_to_a_station_that_connects_meanwhile() {
    const LIMITS: &str = "Battery 1 limits the motors: over 20W";
    let mut rover = Limited::new();
    rover.steer_for(1, 0, 1000);
    assert_eq!(rover.seen_by_another(), [""; 0]);
    rover.assert_limited(0, 1000);
    assert_eq!(rover.seen_by_another(), [LIMITS]);
    rover.full_w = 15.0;
    rover.steer_for(8, 0, 1000);
    assert_eq!(rover.seen_by_another(), [LIMITS], "not ended yet");
    rover.steer_for(8, 0, 1000);
    assert_eq!(rover.seen_by_another(), [""; 0]);
    assert_eq!(rover.announced("Battery 1 no longer limits the motors"), 1);
    rover.full_w = 52.0;
    rover.assert_limited(0, 1000);
    assert_eq!(rover.announced(LIMITS), 2);
    rover.desk.ask(&disarm());
    assert_eq!(rover.seen_by_another(), [""; 0], "disarmed, nothing is limited");
}

#[test]
// Requirement: AP-28
fn a_limit_can_be_taken_back_while_its_sensor_is_lost_and_one_that_is_set_again_is_held() {
    for (max_w, is_released) in [(0.0, true), (1000.0, true), (21.0, true), (LIMIT_W, false)] {
        let mut rover = Limited::new();
        rover.assert_limited(0, 1000);
        let held_w = rover.drawn_w();
        rover.is_connected = false;
        rover.steer_for(10, 0, 1000);
        rover.set_limit(max_w);
        let supplied = rover.steer_for(2, 0, 1000);
        let expected_w = if is_released { rover.full_w } else { held_w };
        let after = supplied[supplied.len() - 1];
        assert!((after / expected_w - 1.0).abs() < 0.03, "{max_w}: {after} W");
    }
}

#[test]
// Requirement: AP-28
fn a_limit_without_a_current_is_announced_once_at_each_arming() {
    const IDLE: &str = "can't limit the motors: current unknown";
    let changes: [fn(&mut Limited); 2] = [|rover| rover.amperes = 0.0, |rover| rover.is_connected = false];
    for change in changes {
        let mut rover = Limited::with(|rover| {
            change(rover);
            rover.desk.set(id_of("ARMING_CHECK"), 0.0);
        });
        rover.steer_for(20, 0, 1000);
        assert_eq!(
            rover.announced(&format!("Battery 1 {IDLE}")),
            1,
            "{:?}",
            rover.texts
        );
        rover.desk.ask(&disarm());
        rover.steer_for(1, 0, 0);
        rover.desk.ask(&arm());
        rover.steer_for(1, 0, 0);
        // The second pack is not monitored.
        assert_eq!(rover.announced(IDLE), 2, "{:?}", rover.texts);
    }
}

#[test]
// Requirement: AP-28
fn a_current_that_was_found_reversed_limits_nothing_and_the_next_arming_says_so() {
    let mut rover = Limited::with(|rover| {
        rover.amperes = -1.0;
        rover.pack_ohm = 0.1;
    });
    for _ in 0..20 {
        rover.steer_for(5, 0, 1000);
        rover.steer_for(5, 0, 0);
    }
    assert_eq!(rover.announced("Battery 1 current sensor reversed?"), 1);
    assert_eq!(rover.announced("can't limit the motors"), 0);
    rover.desk.ask(&disarm());
    rover.steer_for(1, 0, 0);
    rover.desk.ask(&arm());
    rover.steer_for(1, 0, 0);
    assert_eq!(
        rover.announced("Battery 1 can't limit the motors: current unknown"),
        1
    );
}

#[test]
// Requirement: AP-28
fn turning_on_the_spot_is_limited_too() {
    let mut rover = Limited::new();
    rover.assert_unlimited(1000, 0);
    rover.assert_limited(1000, 0);
    rover.assert_limited(-1000, 0);
}

#[test]
// Requirement: AP-28
fn a_wire_that_breaks_while_driving_holds_the_limit() {
    let mut rover = Limited::new();
    rover.assert_limited(0, 1000);
    let held_w = rover.drawn_w();
    rover.is_connected = false;
    let held = rover.steer_for(10, 0, 1000);
    let is_held = |power_w: &f32| (power_w / held_w - 1.0).abs() < 0.03;
    assert!(held.iter().all(is_held), "{held:.1?}");
    assert_eq!(rover.announced("Battery 1 unhealthy"), 1);
}

#[test]
fn a_limited_rover_reverses_gently_but_stops_within_a_second() {
    let mut rover = Limited::new();
    rover.assert_limited(0, 1000);
    rover.desk.set(VehicleParameter::MotSlewrate, 20.0);
    let ahead_w = rover.steer_for(1, 0, -1000);
    assert!(
        ahead_w.is_sorted_by(|before, after| before >= after),
        "{ahead_w:.1?}"
    );
    assert_eq!(rover.drawn_w(), 0.0, "{ahead_w:.1?}");
    rover.steer_for(1, 0, -1000);
    let MotorDrive::Turn(back) = rover.desk.vehicle().drives().left else {
        panic!("it stands");
    };
    assert!((-0.21..-0.1).contains(&back), "{back}");
}
