//! The CAN controller beside what shares its pins: a power monitor at the same SPI bus, a fuel sensor at GP17.

use std::cell::RefCell;
use std::rc::Rc;

use emulator::LogLevel;
use emulator::spi_devices::Ina239;
use support::frames::{last_of, texts_of};
use support::monitor_types::{DRONECAN, FUEL_FLOW};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};
use workbench::can::{CanRig, transfers};

const INA239: f32 = 26.0;
const INA239_SELECT: usize = 22;

/// As often as a battery reports.
const INTERVAL_US: u64 = 100 * MILLISECOND;

/// A board with a controller that has this crystal, set up with these parameters.
fn with_can(crystal_hz: u64, bits_per_second: u64, parameters: &[(&str, f32)]) -> (Bench, CanRig) {
    let mut bench = Bench::running(DIVIDER_CODE);
    let rig = CanRig::new(&mut bench, crystal_hz, bits_per_second);
    bench.set_all(&[("CAN_P1_DRIVER", 1.0), ("SR0_EXTRA1", 10.0)]);
    bench.set_all(parameters);
    bench.forget_sent();
    bench.reboot();
    (bench, rig)
}

fn texts(bench: &mut Bench) -> Vec<String> {
    texts_of(&bench.frames())
}

fn assert_measures_battery_a(bench: &mut Bench, rig: &CanRig) {
    let mut battery = rig.peer();
    let sent = &mut [(&mut battery, [transfers::STATUS_A, transfers::A].as_slice())];
    rig.run_with(bench, 2 * SECOND, INTERVAL_US, sent);
    let frames = bench.frames();
    let status = last_of(&frames, 1);
    assert_eq!((status.voltage_mv(0), status.current_ca()), (12_500, 325));
}

#[test]
fn every_bit_rate_works_with_both_crystals() {
    for (crystal_mhz, bit_rate) in [
        (16, 125_000),
        (8, 125_000),
        (16, 250_000),
        (8, 250_000),
        (16, 500_000),
        (8, 500_000),
    ] {
        let parameters = [
            ("CAN_P1_CRYSTAL", crystal_mhz as f32),
            ("CAN_P1_BITRATE", bit_rate as f32),
            ("BATT2_MONITOR", DRONECAN),
        ];
        let (mut bench, rig) = with_can(crystal_mhz * 1_000_000, bit_rate, &parameters);
        assert_measures_battery_a(&mut bench, &rig);
    }
}

#[test]
fn a_crystal_that_is_too_slow_is_announced_and_the_bus_stays_off() {
    let parameters = [("CAN_P1_CRYSTAL", 8.0), ("BATT2_MONITOR", DRONECAN)];
    let (mut bench, rig) = with_can(8_000_000, 500_000, &parameters);
    bench.run_for(3 * SECOND);
    let texts = texts(&mut bench);
    for text in [
        "CAN off: 1 Mbit/s needs a 16 MHz crystal",
        "Battery 2 unhealthy: port not set up",
    ] {
        assert!(texts.iter().any(|other| other == text), "{text}: {texts:?}");
    }
    // CANCTRL as it is after a reset (DS20001801, register 10-1).
    assert_eq!(
        rig.chip.borrow().register(0x0f),
        0x87,
        "the controller was left alone"
    );
}

#[test]
fn a_power_monitor_is_read_at_the_same_bus() {
    let monitor = Rc::new(RefCell::new(Ina239::new(0.0002)));
    monitor.borrow_mut().set(24.0, 10.0, 30.0);
    let (mut bench, rig) = with_can(
        16_000_000,
        1_000_000,
        &[
            ("BATT2_MONITOR", DRONECAN),
            ("BATT3_MONITOR", INA239),
            ("BATT3_SHUNT", 0.0002),
        ],
    );
    bench.spi1().attach(INA239_SELECT, Box::new(monitor.clone()));
    assert_measures_battery_a(&mut bench, &rig);
    bench.run_for(SECOND);
    let frames = bench.frames();
    let status = last_of(&frames, 2);
    assert!(
        status.voltage_mv(0).abs_diff(24_000) <= 10,
        "{} mV",
        status.voltage_mv(0)
    );
    assert!(
        status.current_ca().abs_diff(1000) <= 10,
        "{} cA",
        status.current_ca()
    );
    assert_eq!(bench.logged(LogLevel::Warn, "lost").len(), 0);
}

#[test]
fn the_interrupt_line_takes_the_pin_of_a_fuel_sensor() {
    let parameters = [("BATT2_MONITOR", FUEL_FLOW), ("BATT2_CURR_PIN", 17.0)];
    let (mut bench, _rig) = with_can(16_000_000, 1_000_000, &parameters);
    bench.run_for(3 * SECOND);
    let texts = texts(&mut bench);
    let expected = "Battery 2 unhealthy: pin already in use";
    assert!(texts.iter().any(|text| text == expected), "{texts:?}");
}

#[test]
fn a_pack_on_a_bus_that_is_off_says_so() {
    let mut bench = Bench::configured(DIVIDER_CODE, &[("BATT2_MONITOR", DRONECAN)]);
    bench.run_for(3 * SECOND);
    let texts = texts(&mut bench);
    let expected = "Battery 2 unhealthy: port not set up";
    assert!(texts.iter().any(|text| text == expected), "{texts:?}");
}
