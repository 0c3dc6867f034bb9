//! The firmware examples as a stranger flashes them: what is at the pins arrives on the wire.

use std::rc::Rc;

use emulator::AdcInput;
use emulator::i2c_devices::Ina226;
use support::charge_states::OK;
use support::frames::{
    BATTERY_STATUS, BatteryStatus, HEARTBEAT, SYS_STATUS, SysStatus, assert_no_sequence_gap, last_of,
    of_message, texts_of,
};
use workbench::bench::{Bench, SECOND};
use workbench::i2c_bus::{BUS, shared};

const GP26: usize = 0;
const GP27: usize = 1;
const GP28: usize = 2;

const LED: usize = 25;

const LIPO: u8 = 1;
const LION: u8 = 3;
const UNKNOWN_CA: i16 = -1;
const LOW: u8 = 2;

/// A step of the converter is 3.3 V / 4095.
fn at_pin(volts: f64) -> AdcInput {
    AdcInput::Code((volts / 3.3 * 4095.0).round() as u16)
}

/// A step of the converter behind a divider of 4 are 3.2 mV.
#[track_caller]
fn assert_voltage(status: &BatteryStatus<'_>, volts: f64) {
    let off_mv = f64::from(status.voltage_mv(0)) - 1000.0 * volts;
    assert!(off_mv.abs() < 3.5, "{} mV", status.voltage_mv(0));
}

#[track_caller]
fn assert_within<T: PartialOrd + std::fmt::Debug>(expected: std::ops::RangeInclusive<T>, value: T) {
    assert!(expected.contains(&value), "{value:?}, not {expected:?}");
}

#[test]
fn the_analog_monitor_reports_the_pack_at_its_divider_and_lights_the_led_while_it_is_fine() {
    let mut bench = Bench::power_up_example("analog_monitor");
    bench.adc_input(GP26, at_pin(11.7 / 4.0));
    bench.run_for(33 * SECOND - SECOND / 4);
    let frames = bench.frames();
    let counts = [HEARTBEAT, SYS_STATUS, BATTERY_STATUS].map(|message| of_message(&frames, message).len());
    assert_eq!(counts, [33, 66, 66]);
    assert_no_sequence_gap(&frames);
    let status = last_of(&frames, 0);
    assert_voltage(&status, 11.7);
    assert_eq!((status.current_ca(), status.charge_state()), (UNKNOWN_CA, OK));
    assert_within(40..=70, status.remaining_pct());
    let sys_status = of_message(&frames, SYS_STATUS);
    assert_eq!(SysStatus(sys_status[65]).voltage_mv(), status.voltage_mv(0));
    assert_eq!(bench.pin_level(LED), Some(true));

    bench.adc_input(GP26, at_pin(10.4 / 4.0));
    bench.run_for(11 * SECOND);
    let frames = bench.frames();
    assert_voltage(&last_of(&frames, 0), 10.4);
    assert_eq!(last_of(&frames, 0).charge_state(), LOW);
    assert_eq!(texts_of(&frames), ["Battery 1 is low 10.40V used 0 mAh"]);
    assert_eq!(bench.pin_level(LED), Some(false));

    bench.assert_untroubled();
}

#[test]
fn two_packs_are_reported_and_monitored_each_by_its_own_settings() {
    let mut bench = Bench::power_up_example("two_packs");
    bench.adc_input(GP26, at_pin(11.4 / 4.0));
    bench.adc_input(GP27, at_pin(12.0 / 20.0));
    bench.adc_input(GP28, at_pin(7.4 / 3.0));
    bench.run_for(4 * SECOND);
    let frames = bench.frames();
    assert_no_sequence_gap(&frames);
    let [drive, electronics] = [0, 1].map(|instance| last_of(&frames, instance));
    assert_voltage(&drive, 11.4);
    assert_voltage(&electronics, 7.4);
    assert_within(1199..=1201, drive.current_ca());
    // 12 A for 4 s are 13.3 mAh.
    assert_within(12..=13, drive.consumed_mah());
    assert_eq!(
        (electronics.current_ca(), electronics.consumed_mah()),
        (UNKNOWN_CA, -1)
    );
    assert_eq!((drive.battery_type(), electronics.battery_type()), (LIPO, LION));
    assert_eq!((drive.charge_state(), electronics.charge_state()), (OK, OK));

    // It is low by its own threshold; the other one is not.
    bench.adc_input(GP28, at_pin(6.3 / 3.0));
    bench.run_for(11 * SECOND);
    let frames = bench.frames();
    assert_eq!(texts_of(&frames), ["Battery 2 is low 6.30V used 0 mAh"]);
    let [drive, electronics] = [0, 1].map(|instance| last_of(&frames, instance));
    assert_eq!((drive.charge_state(), electronics.charge_state()), (OK, LOW));
    bench.assert_untroubled();
}

#[test]
fn an_ina226_alone_is_read_and_its_loss_is_announced() {
    const ADDRESS: u8 = 0x40;
    let part = shared(Ina226::new(0.002));
    part.borrow_mut().set(11.7, 10.0);
    let mut bench = Bench::power_up_example("ina226");
    bench.i2c(BUS).attach(ADDRESS, Box::new(Rc::clone(&part)));
    bench.run_for(9 * SECOND);
    let frames = bench.frames();
    assert_no_sequence_gap(&frames);
    let status = last_of(&frames, 0);
    // Both are whole steps of the part.
    assert_eq!((status.voltage_mv(0), status.current_ca()), (11_700, 1000));
    // 10 A for 9 s are 25 mAh and 10.5 hJ.
    assert_within(23..=25, status.consumed_mah());
    assert_within(9..=10, status.energy_hj());
    assert!(status.time_remaining_s() > 0);

    bench.i2c(BUS).detach(ADDRESS);
    bench.run_for(2 * SECOND);
    assert_eq!(texts_of(&bench.frames()), ["Battery 1 unhealthy: no answer"]);
    assert!(bench.resets().is_empty() && bench.bus_errors().is_empty());
}
