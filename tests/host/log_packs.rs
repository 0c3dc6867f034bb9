//! Logs of packs: which board and which packs they are of, and their failsafes.

use std::io::Cursor;

use ardupilot_binlog::{Entry, Reader};
use nor_flash::FlashModel;
use rover_battmon::autopilot::PackIdentity;
use rover_battmon::battery::{Measurement, PackDetails, ReadError};
use rover_battmon::memory::identity::BoardId;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::BatteryParameter;
use rover_battmon::sensor::{ADC_FULL_SCALE, ADC_REFERENCE_V, AnalogPin, AnalogReadings, Conversions};
use rover_battmon::vehicle::SideDrives;
use support::desk::{DIVIDER, Desk, conversions, start_with};
use support::frames::texts_of;
use support::learnt_record::learnt_words;
use support::monitor_types::SMART_BATTERY;
use support::requests::{arm_by_force, disarm};

use crate::logged_rover::Rover;

const BOARD_ID: BoardId = BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c]);
const UNKNOWN: i64 = -1;

/// A board with a smart battery that was not read yet.
fn rover(board_id: Option<BoardId>) -> Rover {
    let mut start = start_with(&[("BATT_MONITOR", SMART_BATTERY)]);
    start.identity.board_id = board_id;
    Rover::with(Desk::starting(start), FlashModel::blank())
}

impl Rover {
    /// Has the battery report this serial number, if it has one, for half a second.
    fn report(&mut self, serial_number: Option<i32>) {
        let reading = Measurement {
            voltage_v: Some(8.0),
            details: PackDetails {
                serial_number,
                ..PackDetails::default()
            },
            ..Measurement::default()
        };
        for _ in 0..5 {
            let now = self.desk.now();
            self.desk.autopilot.add_bus_reading(Pack::First, Ok(reading), now);
            self.desk.sample(AnalogReadings::NONE);
            self.desk.now_us += 100_000;
        }
        self.run(2);
    }

    /// Has the battery report this voltage for a time, in seconds.
    fn hold(&mut self, voltage_v: f32, seconds: u64) {
        let reading = Measurement {
            voltage_v: Some(voltage_v),
            ..Measurement::default()
        };
        for _ in 0..10 * seconds {
            let now = self.desk.now();
            self.desk.autopilot.add_bus_reading(Pack::First, Ok(reading), now);
            self.desk.sample(AnalogReadings::NONE);
            (0..5).for_each(|_| self.turn());
        }
    }

    /// The file's records of this name.
    fn records(&mut self, name: &str) -> Vec<Entry> {
        let reader = Reader::new(Cursor::new(self.file(1)));
        let records = reader.map(|record| record.expect("no error"));
        records.filter(|record| record.name == name).collect()
    }

    /// The texts in the file.
    fn messages(&mut self) -> Vec<String> {
        let messages = self.records("MSG");
        let texts = messages.iter().filter_map(|record| record.get_str("Message"));
        texts.map(str::to_string).collect()
    }

    /// The serial numbers of the file's PACK records.
    fn serial_numbers(&mut self) -> Vec<i64> {
        let packs = self.records("PACK");
        packs.iter().filter_map(|record| record.get_i64("SN")).collect()
    }
}

#[test]
fn a_log_is_of_the_board_whose_id_is_known() {
    for (board_id, expected) in [(Some(BOARD_ID), vec!["E660583883450A2C"]), (None, vec![])] {
        let mut rover = rover(board_id);
        rover.drive(2);
        let boards = rover.records("BRD");
        let ids: Vec<_> = boards.iter().filter_map(|record| record.get_str("Id")).collect();
        assert_eq!(ids, expected);
    }
}

#[test]
fn a_serial_number_that_is_read_after_the_log_began_is_recorded_and_so_is_another_one() {
    let mut rover = rover(Some(BOARD_ID));
    rover.drive(2);
    assert_eq!(rover.serial_numbers(), [UNKNOWN]);
    rover.report(Some(4711));
    assert_eq!(rover.serial_numbers(), [UNKNOWN, 4711]);
    rover.report(Some(4711));
    assert_eq!(rover.serial_numbers(), [UNKNOWN, 4711]);
    rover.report(Some(4712));
    assert_eq!(rover.serial_numbers(), [UNKNOWN, 4711, 4712]);
}

#[test]
fn what_is_read_from_flash_after_the_log_began_is_recorded() {
    let mut rover = rover(None);
    rover.drive(2);
    let identity = PackIdentity {
        pack: Pack::First,
        serial_number: None,
    };
    let words = learnt_words(None, 2950.0);
    rover.desk.learnt_read(identity, Ok(Some(words)));
    rover.run(2);
    let packs = rover.records("PACK");
    let capacities: Vec<_> = packs.iter().filter_map(|record| record.get_f64("Cap")).collect();
    assert!(
        capacities[0].is_nan() && capacities[1..] == [2950.0],
        "{capacities:?}"
    );
}

#[test]
fn what_is_learnt_of_another_pack_is_recorded_with_its_serial_number_only() {
    let mut rover = rover(None);
    rover.drive(2);
    rover
        .desk
        .set(BatteryParameter::SerialNum.of(Pack::First), 4712.0);
    let identity = PackIdentity {
        pack: Pack::First,
        serial_number: Some(4712),
    };
    let words = learnt_words(Some(4712), 2950.0);
    rover.desk.learnt_read(identity, Ok(Some(words)));
    rover.run(2);
    assert_eq!(rover.serial_numbers(), [UNKNOWN]);
    rover.report(None);
    assert_eq!(rover.serial_numbers(), [UNKNOWN, 4712]);
}

#[test]
fn why_a_drive_taught_nothing_is_in_the_log_and_not_on_the_wire() {
    let mut rover = rover(None);
    let identity = PackIdentity {
        pack: Pack::First,
        serial_number: None,
    };
    rover.desk.learnt_read(identity, Ok(None));
    rover.desk.set(BatteryParameter::Cells.of(Pack::First), 2.0);
    let arm = |rover: &mut Rover, request: &[u8]| {
        rover.desk.ask(request);
        for _ in 0..20 {
            rover.report(None);
        }
        rover.desk.sent()
    };
    let mut sent = arm(&mut rover, &arm_by_force());
    sent.extend(arm(&mut rover, &disarm()));
    let expected = "Battery 1 not learnt: no current sensor";
    let logged = rover.messages();
    let times = logged.iter().filter(|text| *text == expected).count();
    assert_eq!(times, 1, "{logged:?}");
    let announced = texts_of(&sent);
    assert!(
        !announced.iter().any(|text| text.contains("not learnt")),
        "{announced:?}"
    );
}

#[test]
// Requirement: AP-18, AP-21
fn a_log_has_each_start_reset_and_trip_of_a_failsafes_timer() {
    const LOW: f64 = 2.0;
    const STOPPED: f64 = 0.0;
    const RUNNING: f64 = 1.0;
    const EXPIRED: f64 = 2.0;
    let mut rover = rover(None);
    rover.desk.set(BatteryParameter::LowVolt.of(Pack::First), 10.5);
    rover.desk.set(BatteryParameter::CrtVolt.of(Pack::First), 9.9);
    rover.desk.ask(&arm_by_force());
    let start_s = rover.desk.now_us as f64 * 1e-6;
    // The timer is 10 s; a reading below the threshold after it has expired changes nothing.
    for (voltage_v, seconds) in [(11.0, 5), (10.4, 4), (11.0, 2), (10.4, 12), (11.0, 2), (10.4, 2)] {
        rover.hold(voltage_v, seconds);
    }
    rover.run(2);
    let timer = |record: &Entry| {
        let number = |field| record.get_f64(field).expect("a number");
        let since_s = number("TimeUS") * 1e-6 - start_s;
        ((10.0 * since_s).round() / 10.0, number("FS"), number("Tmr"))
    };
    let timers: Vec<_> = rover.records("FSTM").iter().map(timer).collect();
    assert_eq!(
        timers,
        [
            (5.0, LOW, RUNNING),
            (9.0, LOW, STOPPED),
            (11.0, LOW, RUNNING),
            (21.1, LOW, EXPIRED)
        ]
    );
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
    // Once a second.
    let sample_at = |rover: &mut Rover, voltage_v: f32, seconds: u64| {
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, Ok(conversions(voltage_v / DIVIDER)));
        for _ in 0..seconds {
            rover.desk.sample(readings);
            rover.run(1);
        }
    };
    sample_at(&mut rover, 11.4, 3);
    rover.desk.ask(&arm_by_force());
    sample_at(&mut rover, 11.4, 3);
    sample_at(&mut rover, 10.0, 5);
    assert_eq!(rover.desk.drive(), SideDrives::BRAKE);
    rover.desk.post_due(rover.desk.now_us);
    let [low, critical] = ["low", "critical"].map(|level| format!("Battery 1 is {level} 10.00V used 0 mAh"));
    let mut announced = texts_of(&rover.desk.sent());
    let mut logged = rover.messages();
    for texts in [&mut announced, &mut logged] {
        texts.retain(|text| text.contains(" is "));
    }
    assert_eq!(announced, std::slice::from_ref(&critical));
    assert_eq!(logged, [low, critical]);
}

/// Conversions of a pin within a tick, of which one is another.
fn with_one(steady_v: f32, single_v: f32) -> Conversions {
    let codes =
        [steady_v, single_v].map(|pin_v| (pin_v / ADC_REFERENCE_V * f32::from(ADC_FULL_SCALE)) as u16);
    let steady = std::iter::repeat_n(codes[0], 408);
    Conversions::from_codes(steady.chain([codes[1]])).expect("there are some")
}

/// A rover with a pack whose voltage and current are measured, and a second one of which the voltage is.
fn rover_with_two_packs() -> Rover {
    let start = start_with(&[
        ("BATT_MONITOR", 4.0),
        ("BATT_CURR_PIN", 27.0),
        ("BATT_AMP_PERVLT", 10.0),
        ("BATT2_MONITOR", 3.0),
        ("BATT2_VOLT_PIN", 28.0),
        ("BATT2_VOLT_MULT", DIVIDER),
    ]);
    let mut rover = Rover::with(Desk::starting(start), FlashModel::blank());
    rover.desk.ask(&arm_by_force());
    rover
}

const PIN_V: f32 = 2.8;
const CURRENT_PIN_V: f32 = 0.5;

impl Rover {
    /// Samples packs that give 2.8 V at the pins of their dividers and 5 A, with one other conversion each. Time passes.
    fn sample_with(&mut self, [first_v, current_v, second_v]: [f32; 3]) {
        let mut readings = AnalogReadings::NONE;
        for (pin, conversions) in [
            (AnalogPin::Gp26, with_one(PIN_V, first_v)),
            (AnalogPin::Gp27, with_one(CURRENT_PIN_V, current_v)),
            (AnalogPin::Gp28, with_one(PIN_V, second_v)),
        ] {
            readings.set(pin, Ok(conversions));
        }
        self.tick(readings);
    }

    fn tick(&mut self, readings: AnalogReadings) {
        self.desk.sample(readings);
        (0..5).for_each(|_| self.turn());
    }

    /// Field of a pack's records, with the seconds since the start.
    fn field(&mut self, name: &str, pack: Pack, field: &str) -> Vec<(f64, f64)> {
        let number = |record: &Entry, field| record.get_f64(field).expect("a number");
        let records = self.records(name);
        let of_pack = records
            .iter()
            .filter(|record| number(record, "Inst") == f64::from(pack.instance()));
        of_pack
            .map(|record| (number(record, "TimeUS") * 1e-6, number(record, field)))
            .collect()
    }

    /// The values of such a field that differ by more than the noise from `usual`.
    fn unusual(&mut self, pack: Pack, field: &str, usual: f64) -> Vec<(f64, f64)> {
        let mut values = self.field("BATX", pack, field);
        values.retain(|(_, value)| (value - usual).abs() > 0.02);
        values
    }
}

#[test]
fn a_single_conversion_is_in_the_next_batx_of_its_pack_and_hardly_in_the_mean() {
    let mut rover = rover_with_two_packs();
    let steady = [PIN_V, CURRENT_PIN_V, PIN_V];
    let mut at_s = vec![];
    for [first_v, current_v, second_v] in [
        steady,
        [1.0, 3.0, PIN_V],
        steady,
        [PIN_V, CURRENT_PIN_V, 1.5],
        steady,
    ] {
        at_s.push(rover.desk.now_us as f64 * 1e-6);
        rover.sample_with([first_v, current_v, second_v]);
        (0..40).for_each(|_| rover.sample_with(steady));
    }
    rover.run(2);
    let usual_v = f64::from(PIN_V * DIVIDER);
    for (pack, field, usual, event_s, expected) in [
        (Pack::First, "VMin", usual_v, at_s[1], 3.95),
        (Pack::First, "IMax", 5.0, at_s[1], 30.0),
        (Pack::Second, "VMin", usual_v, at_s[3], 5.92),
    ] {
        let batx_s: Vec<f64> = rover
            .field("BATX", pack, field)
            .iter()
            .map(|(time_s, _)| *time_s)
            .collect();
        assert!(batx_s.len() > 8, "{batx_s:?}");
        let next_s = batx_s
            .into_iter()
            .find(|time_s| *time_s >= event_s)
            .expect("one follows");
        let unusual = rover.unusual(pack, field, usual);
        assert_eq!(unusual.len(), 1, "{pack:?} {field}: {unusual:?}");
        let (time_s, value) = unusual[0];
        assert_eq!(time_s, next_s);
        assert!((value - expected).abs() < 0.02, "{pack:?} {field}: {value}");
    }
    for (pack, field, usual) in [
        (Pack::First, "Volt", usual_v),
        (Pack::First, "Curr", 5.0),
        (Pack::Second, "Volt", usual_v),
    ] {
        let means = rover.field("BAT", pack, field);
        assert!(
            means.iter().all(|(_, mean)| (mean - usual).abs() < 0.1),
            "{means:?}"
        );
    }
    let currents = rover.field("BATX", Pack::Second, "IMax");
    assert!(
        currents.iter().all(|(_, current_a)| current_a.is_nan()),
        "{currents:?}"
    );
}

#[test]
fn a_failed_read_and_a_pack_that_is_unplugged_have_no_extremes() {
    let mut rover = rover_with_two_packs();
    let at_pins = |pin_v| {
        let mut readings = AnalogReadings::NONE;
        for pin in [AnalogPin::Gp26, AnalogPin::Gp27, AnalogPin::Gp28] {
            readings.set(pin, Ok(conversions(pin_v)));
        }
        readings
    };
    let mut without_current = at_pins(PIN_V);
    without_current.set(AnalogPin::Gp27, Err(ReadError::Timeout));
    for (readings, second_is_known) in [(without_current, true), (at_pins(0.0), false)] {
        (0..10).for_each(|_| rover.sample_with([PIN_V, CURRENT_PIN_V, PIN_V]));
        let from_s = rover.desk.now_us as f64 * 1e-6;
        (0..60).for_each(|_| rover.tick(readings));
        rover.run(2);
        for (pack, field, is_known) in [
            (Pack::First, "VMin", false),
            (Pack::First, "IMax", false),
            (Pack::Second, "VMin", second_is_known),
        ] {
            let mut values = rover.field("BATX", pack, field);
            values.retain(|(time_s, _)| *time_s >= from_s);
            // The first has the readings before, too.
            assert!(values.len() > 2 && !values[0].1.is_nan(), "{values:?}");
            let is_as_expected = |(_, value): &(f64, f64)| value.is_nan() != is_known;
            assert!(
                values[1..].iter().all(is_as_expected),
                "{pack:?} {field}: {values:?}"
            );
        }
    }
}
