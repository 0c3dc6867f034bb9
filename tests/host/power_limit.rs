//! The power limit of a pack, which supplies the motors by the square of their duties.

use rover_battmon::battery::{BusError, Measurement};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::VehicleParameter;
use rover_battmon::sensor::AnalogReadings;
use rover_battmon::vehicle::MotorDrive;
use support::commands::ACCEPTED;
use support::desk::{Desk, start_with};
use support::frames::texts_of;
use support::monitor_types::INA2XX;
use support::requests::{VEHICLE_ID, arm, do_set_mode, manual_control};

const MANUAL: f32 = 0.0;

const PACK_V: f32 = 11.4;
const LIMIT_W: f32 = 20.0;

/// A rover whose pack is measured by a part on the bus.
struct Limited {
    desk: Desk,
    /// All motors at full duty.
    full_w: f32,
    is_connected: bool,
    texts: Vec<String>,
}

impl Limited {
    /// Armed in MANUAL.
    fn new() -> Self {
        let start = start_with(&[
            ("BATT_MONITOR", INA2XX),
            ("BATT_CELLS", 3.0),
            ("BATT_WATT_MAX", LIMIT_W),
        ]);
        let mut rover = Self {
            desk: Desk::starting(start),
            full_w: 52.0,
            is_connected: true,
            texts: Vec::new(),
        };
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
                voltage_v: Some(PACK_V),
                current_a: Some(drawn_w / PACK_V),
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
    assert_eq!(rover.announced("limits the motors"), 1);
    assert_eq!(rover.announced("fault"), 0);
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
