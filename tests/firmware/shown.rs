//! Situations of which `tests/gcs/test_shown.py` derives what ground stations show: what the board sends in them, recorded
//! in `target/tmp/shown/`.

use std::fs;
use std::path::Path;

use emulator::i2c_devices::{Pec, SmartBattery};
use emulator::{AdcFault, AdcInput};
use support::charge_states::{FAILED, OK, UNHEALTHY};
use support::commands::{BATTERY_RESET, RUN_PREARM_CHECKS, SET_MESSAGE_INTERVAL};
use support::frames::{
    BATTERY_INFO, BATTERY_STATUS, BATTERY_STATUS_V2, Frame, SYS_STATUS, SysStatus, last_of, of_message,
    texts_of, tlog,
};
use support::requests::{VEHICLE, arm, command_long, command_long_2, param_read_by_name, param_request_list};
use workbench::bench::{Bench, CURRENT, PACK, SAVED_US, SECOND, TestedVehicle};
use workbench::i2c_bus::BUS;
use workbench::signing_key::protected;

const AMPERES_PER_VOLT: f64 = 17.0;

const CURRENT_SENSOR: [(&str, f32); 4] = [
    ("BATT_MONITOR", 4.0),
    ("BATT_CURR_PIN", 27.0),
    ("BATT_CELLS", 3.0),
    ("BATT_CAPACITY", 1000.0),
];

const FULL_V: f64 = 12.58;

const SMART_BATTERY_ADDRESS: u8 = 0x0b;

/// MAV_BATTERY_CHARGE_STATE
const UNDEFINED: u8 = 0;
const EMERGENCY: u8 = 4;

/// Who is connected.
#[derive(Clone, Copy, PartialEq)]
enum Station {
    /// Content with BATTERY_STATUS.
    Old,
    /// A QGroundControl that moves over to BATTERY_STATUS_V2.
    New,
}

impl Station {
    fn connect(self, bench: &mut Bench) {
        bench.run_for(SECOND);
        bench.ask(&param_request_list(VEHICLE));
        if self == Self::New {
            for (message, interval_us) in [
                (BATTERY_STATUS_V2, 2e6),
                (BATTERY_INFO, 1e7),
                (BATTERY_STATUS, -1.0),
            ] {
                bench.ask(&command_long_2(SET_MESSAGE_INTERVAL, message as f32, interval_us));
            }
        }
    }
}

/// Records what a ground station gets of a board while something happens to it.
fn record(situation: &str, station: Station, mut bench: Bench, happen: impl Fn(&mut Bench)) -> Vec<Frame> {
    bench.run_until_silent();
    bench.forget_sent();
    station.connect(&mut bench);
    happen(&mut bench);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("shown");
    fs::create_dir_all(&folder).expect("a folder for recordings");
    let station = if station == Station::Old { "old" } else { "new" };
    let file = folder.join(format!("{situation}.{station}.tlog"));
    fs::write(&file, tlog(bench.sent())).expect("a recording");
    bench.frames()
}

/// Records with both, one board after the other.
fn record_both(situation: &str, board: impl Fn() -> Bench, happen: impl Fn(&mut Bench)) -> Vec<Frame> {
    record(situation, Station::New, board(), &happen);
    record(situation, Station::Old, board(), &happen)
}

/// What the converter makes of a voltage of the pack.
fn code(pack_v: f64) -> u16 {
    (pack_v / 3.95 / 3.3 * 4095.0).round() as u16
}

/// Asks for them, and a second later they are reported.
fn prearm_checks(bench: &mut Bench) {
    bench.ask(&command_long(RUN_PREARM_CHECKS, 0.0));
    bench.run_for(SECOND);
}

fn draw(bench: &mut Bench, amperes: f64) {
    bench.adc_input(CURRENT, AdcInput::Volts(amperes / AMPERES_PER_VOLT));
}

/// What was reported last: the charge state, and whether the rover is ready to arm.
fn last_reported(frames: &[Frame]) -> (u8, bool) {
    let status = SysStatus(of_message(frames, SYS_STATUS).pop().expect("a SYS_STATUS"));
    (last_of(frames, 0).charge_state(), status.is_ready_to_arm())
}

/// Switches a board off and on: what is sent from the first moment on is recorded.
fn switched_on_again(mut bench: Bench) -> Bench {
    bench.power_cycle();
    bench
}

#[test]
fn healthy() {
    let board = || switched_on_again(Bench::configured(code(FULL_V), &CURRENT_SENSOR));
    let frames = record_both("healthy", board, |bench| bench.run_for(14 * SECOND));
    assert_eq!(last_reported(&frames), (OK, true));
}

#[test]
fn armed() {
    let frames = record("armed", Station::Old, Bench::running(code(FULL_V)), |bench| {
        bench.ask(&arm());
        bench.run_for(5 * SECOND);
    });
    assert_eq!(last_reported(&frames), (OK, true));
}

#[test]
fn below_arming_voltage() {
    let bench = Bench::configured(code(FULL_V), &[("BATT_ARM_VOLT", 11.5)]);
    let frames = record("below_arming_voltage", Station::Old, bench, |bench| {
        bench.adc_input(PACK, AdcInput::Code(code(11.0)));
        bench.run_for(3 * SECOND);
        prearm_checks(bench);
    });
    assert_eq!(last_reported(&frames), (OK, false));
}

#[test]
fn flooded() {
    let too_much = [("SERIAL0_BAUD", 9.0), ("SR0_EXTRA1", 50.0)];
    let bench = switched_on_again(Bench::configured(code(FULL_V), &too_much));
    let frames = record("flooded", Station::Old, bench, |bench| bench.run_for(15 * SECOND));
    let statuses = of_message(&frames, SYS_STATUS);
    assert!(SysStatus(statuses[statuses.len() - 1]).dropped() > 0);
}

#[test]
fn strangers() {
    let frames = record("strangers", Station::Old, protected(), |bench| {
        for _ in 0..5 {
            bench.ask(&param_read_by_name("BATT_LOW_VOLT"));
        }
        bench.run_for(2 * SECOND);
    });
    assert!(texts_of(&frames).iter().any(|text| text.contains("ignored")));
}

#[test]
fn drained() {
    let board = || {
        let mut bench = Bench::configured(code(11.1), &CURRENT_SENSOR);
        // Above the hysteresis of LOW, in which its voltage has put it.
        bench.ask(&command_long_2(BATTERY_RESET, -1.0, 20.0));
        bench.run_for(4 * SECOND);
        bench
    };
    let frames = record_both("drained", board, |bench| {
        // A percent in 2.4 s.
        draw(bench, 15.0);
        bench.run_for(40 * SECOND);
        draw(bench, 0.0);
        bench.run_for(4 * SECOND);
        bench.ask(&arm());
        bench.run_for(SECOND);
    });
    assert_eq!(last_reported(&frames), (EMERGENCY, false));
}

#[test]
fn sensor_lost() {
    let board = || Bench::running(code(FULL_V));
    let frames = record_both("sensor_lost", board, |bench| {
        bench.run_for(3 * SECOND);
        bench.adc_fault(AdcFault::Stalled);
        bench.run_for(8 * SECOND);
        prearm_checks(bench);
    });
    assert_eq!(last_reported(&frames), (UNHEALTHY, false));
}

/// A smart battery of three cells, the second of which is at this voltage.
fn smart_battery(second_cell_mv: u16) -> Box<SmartBattery> {
    const SECOND_CELL_VOLTAGE: u8 = 0x3e;
    const VOLTAGE: u8 = 0x09;
    let mut battery = SmartBattery::new(Pec::Right);
    battery.set_word(SECOND_CELL_VOLTAGE, second_cell_mv);
    battery.set_word(VOLTAGE, 2 * 4_200 + second_cell_mv);
    Box::new(battery)
}

/// Such a battery as the first pack, just switched on.
fn with_smart_battery() -> Bench {
    let mut bench = Bench::running(0);
    bench.i2c(BUS).attach(SMART_BATTERY_ADDRESS, smart_battery(4_200));
    bench.set("BATT_MONITOR", 7.0);
    bench.run_for(SAVED_US);
    switched_on_again(bench)
}

#[test]
fn smart_battery_healthy() {
    let bench = with_smart_battery();
    let frames = record("smart_battery_healthy", Station::Old, bench, |bench| {
        bench.run_for(2 * SECOND);
    });
    assert_eq!(last_reported(&frames), (OK, true));
}

#[test]
fn cell_failed() {
    let frames = record_both("cell_failed", with_smart_battery, |bench| {
        bench.run_for(3 * SECOND);
        bench.i2c(BUS).attach(SMART_BATTERY_ADDRESS, smart_battery(3_200));
        bench.run_for(4 * SECOND);
        bench.ask(&command_long(RUN_PREARM_CHECKS, 0.0));
        bench.ask(&arm());
        bench.run_for(SECOND);
    });
    assert_eq!(last_reported(&frames), (FAILED, false));
}

#[test]
fn unplugged() {
    let board = || Bench::running(code(FULL_V));
    let frames = record_both("unplugged", board, |bench| {
        bench.run_for(3 * SECOND);
        bench.adc_input(PACK, AdcInput::Code(0));
        bench.run_for(8 * SECOND);
        prearm_checks(bench);
    });
    assert_eq!(last_reported(&frames), (UNDEFINED, false));
}

#[test]
fn usb_only() {
    let board = || Bench::running(code(0.5));
    let frames = record_both("usb_only", board, |bench| bench.run_for(8 * SECOND));
    assert_eq!(last_reported(&frames), (UNDEFINED, false));
}
