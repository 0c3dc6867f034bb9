//! Tanks: from the sensors' signals to the messages.

use emulator::AdcInput;
use support::commands::{ACCEPTED, BATTERY_RESET, DENIED, FAILED, REQUEST_MESSAGE};
use support::frames::{BATTERY_STATUS, BatteryStatus, FUEL_STATUS, Frame, STATUSTEXT, of_message, result_of};
use support::requests::command_long_2;
use workbench::bench::{Bench, SECOND};

/// MAV_BATTERY_TYPE_UNKNOWN
const NO_CHEMISTRY: u8 = 0;

/// The level sensor is on GP28.
const LEVEL: usize = 2;

/// A tank of 2 l as the second pack, by ArduPilot's defaults empty at 0.5 V and full at 2.5 V.
const TANK: [(&str, f32); 3] = [
    ("BATT2_MONITOR", 24.0),
    ("BATT2_FL_PIN", 28.0),
    ("BATT2_CAPACITY", 2000.0),
];

/// The code of a voltage at a pin, in hundredths of a volt.
fn code(centivolts: u32) -> AdcInput {
    AdcInput::Code(((centivolts * 4095 + 165) / 330) as u16)
}

/// A board with a full pack and a tank.
fn with_tank(changes: &[(&str, f32)]) -> Bench {
    let mut bench = Bench::configured(2482, &[&TANK[..], changes].concat());
    bench.adc_input(LEVEL, code(250));
    bench.run_for(5 * SECOND);
    bench
}

fn last_of_tank(bench: &mut Bench) -> Frame {
    let frames = bench.frames();
    let statuses = of_message(&frames, BATTERY_STATUS);
    let last = statuses
        .into_iter()
        .rfind(|frame| BatteryStatus(frame).instance() == 1);
    last.expect("the tank has a BATTERY_STATUS").clone()
}

/// The answer to a request for FUEL_STATUS of a pack, and the message if there is one.
fn ask_for_fuel(bench: &mut Bench, instance: f32) -> (u8, Option<Frame>) {
    let answers = bench.ask(&command_long_2(REQUEST_MESSAGE, FUEL_STATUS as f32, instance));
    let result = result_of(&answers);
    (result, of_message(&answers, FUEL_STATUS).pop().cloned())
}

#[test]
// Requirement: AP-10
fn the_level_falls_from_full_to_empty() {
    let mut bench = with_tank(&[]);
    for (centivolts, left_pct) in [(250, 100), (200, 75), (150, 50), (100, 25), (50, 0)] {
        bench.adc_input(LEVEL, code(centivolts));
        // Nine time constants of the filter against sloshing.
        bench.run_for(5 * SECOND);
        let frame = last_of_tank(&mut bench);
        let status = BatteryStatus(&frame);
        assert_eq!(status.remaining_pct(), left_pct, "{centivolts} cV");
        assert!((status.consumed_mah() - 20 * (100 - i32::from(left_pct))).abs() <= 2);
        assert_eq!((status.voltage_mv(0), status.current_ca()), (u16::MAX, -1));
        assert_eq!((status.energy_hj(), status.battery_type()), (-1, NO_CHEMISTRY));

        let (result, fuel) = ask_for_fuel(&mut bench, 1.0);
        let fuel = fuel.expect("the tank has one");
        assert_eq!((result, fuel.u8(24), fuel.u8(25)), (ACCEPTED, 1, left_pct as u8));
        assert_eq!((fuel.f32(0), fuel.u32(20)), (2000.0, 1), "liquid");
        assert!(
            (fuel.f32(8) - 20.0 * f32::from(left_pct)).abs() < 2.0,
            "{} ml",
            fuel.f32(8)
        );
        assert!(fuel.f32(4).is_nan() && fuel.f32(12).is_nan() && fuel.f32(16).is_nan());
    }
}

#[test]
fn a_tank_with_a_level_sensor_is_not_reset() {
    let mut bench = with_tank(&[]);
    assert_eq!(bench.result_of(&command_long_2(BATTERY_RESET, 2.0, 50.0)), FAILED);
    bench.run_for(SECOND);
    assert_eq!(BatteryStatus(&last_of_tank(&mut bench)).remaining_pct(), 100);
}

#[test]
fn a_missing_pin_or_capacity_is_announced() {
    for (missing, reason) in [
        (("BATT2_FL_PIN", -1.0), "Battery 2 unhealthy: no pin set"),
        (("BATT2_CAPACITY", 0.0), "Battery 2 unhealthy: no capacity set"),
    ] {
        let mut bench = with_tank(&[missing]);
        let frames = bench.frames();
        let said = of_message(&frames, STATUSTEXT)
            .iter()
            .any(|frame| frame.text(1, 50) == reason);
        assert!(said, "{reason}");
        assert_eq!(BatteryStatus(&last_of_tank(&mut bench)).remaining_pct(), -1);
        assert_eq!(ask_for_fuel(&mut bench, 1.0), (DENIED, None));
    }
}

#[test]
fn a_shared_pin_is_read_once_a_tick() {
    let mut bench = with_tank(&[("BATT3_MONITOR", 24.0), ("BATT3_FL_PIN", 28.0)]);
    let before = bench.adc_conversions();
    bench.run_for(10 * SECOND);
    // 16 of each of the two pins.
    assert_eq!((bench.adc_conversions() - before).div_ceil(32), 100);
}
