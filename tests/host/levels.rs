//! Failsafe levels of packs: what is done, announced and logged of those that are reached.

use std::io::Cursor;

use ardupilot_binlog::Reader;
use nor_flash::FlashModel;
use rover_battmon::sensor::{AnalogPin, AnalogReadings};
use rover_battmon::vehicle::SideDrives;
use support::desk::{DIVIDER, Desk, adc_count, start_with};
use support::frames::{STATUSTEXT, of_message};
use support::requests::arm_by_force;

use crate::logged_rover::Rover;

/// What the pins read of a pack with this voltage.
fn at_voltage(voltage_v: f32) -> AnalogReadings {
    let mut readings = AnalogReadings::NONE;
    readings.set(AnalogPin::Gp26, Ok(adc_count(voltage_v / DIVIDER)));
    readings
}

impl Rover {
    /// Samples once a second.
    fn sample_for(&mut self, seconds: u64, readings: AnalogReadings) {
        for _ in 0..seconds {
            self.desk.sample(readings);
            self.run(1);
        }
    }
}

#[test]
// Requirement: AP-18
fn a_level_that_is_skipped_is_logged_and_not_announced() {
    let start = start_with(&[
        ("BATT_LOW_TIMER", 1.0),
        ("BATT_LOW_VOLT", 10.5),
        ("BATT_CRT_VOLT", 10.2),
        ("BATT_FS_LOW_ACT", 2.0),
    ]);
    let mut rover = Rover::with(Desk::starting(start), FlashModel::blank());
    rover.sample_for(3, at_voltage(11.4));
    rover.desk.ask(&arm_by_force());
    rover.sample_for(3, at_voltage(11.4));
    rover.sample_for(5, at_voltage(10.0));
    assert_eq!(rover.desk.drive(), SideDrives::BRAKE);
    rover.desk.post_due(rover.desk.now_us);
    let is_level = |text: &String| text.contains(" is ");
    let sent = rover.desk.sent();
    let texts = of_message(&sent, STATUSTEXT).into_iter();
    let texts: Vec<String> = texts.map(|frame| frame.text(1, 50)).filter(is_level).collect();
    assert_eq!(texts, ["Battery 1 is critical 10.00V used 0 mAh"]);
    let reader = Reader::new(Cursor::new(rover.file(1)));
    let records = reader.map(|record| record.expect("no error"));
    let logged: Vec<String> = records
        .filter(|record| record.name == "MSG")
        .filter_map(|record| Some(record.get_str("Message")?.to_string()))
        .filter(is_level)
        .collect();
    assert_eq!(
        logged,
        [
            "Battery 1 is low 10.00V used 0 mAh",
            "Battery 1 is critical 10.00V used 0 mAh"
        ]
    );
}
