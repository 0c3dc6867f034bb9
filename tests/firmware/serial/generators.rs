//! Generators: what they measure reaches ground stations.

use super::{
    LARGE_FUEL_CELL, RICHEN_POWER, SMALL_FUEL_CELL, protocol_4, report, richen_power, send, with_generator,
};
use support::charge_states::UNHEALTHY;
use support::frames::{BatteryStatus, last_of, texts_of};
use workbench::bench::{Bench, SECOND};

fn of_pack<R>(bench: &mut Bench, instance: u8, look: impl FnOnce(BatteryStatus<'_>) -> R) -> R {
    let frames = bench.frames();
    look(last_of(&frames, instance))
}

fn assert_announced_once(bench: &mut Bench, text: &str) {
    let texts = texts_of(&bench.frames());
    let count = texts.iter().filter(|announced| *announced == text).count();
    assert_eq!(count, 1, "{text}: {texts:?}");
}

#[test]
// Requirement: AP-9
fn large_fuel_cell_has_voltage_current_and_tank() {
    let mut bench = with_generator(LARGE_FUEL_CELL);
    // The figures of the maker's manual of the FCPM, section 7.4, with an emptier tank: 100 W into the battery.
    report(&mut bench, b"<152.5,48.7,1600,1700,100,2,0>\n", 8);
    of_pack(&mut bench, 1, |status| {
        assert_eq!((status.voltage_mv(0), status.current_ca()), (48_700, -205));
    });
    of_pack(&mut bench, 2, |status| {
        assert_eq!((status.remaining_pct(), status.consumed_mah()), (50, 50));
        assert_eq!(status.voltage_mv(0), u16::MAX, "a tank has none");
    });
    assert_announced_once(&mut bench, "Fuel cell running");
    report(&mut bench, b"<152.5,48.7,1600,1700,100,3,32>\n", 8);
    assert_announced_once(&mut bench, "Fuel cell has failed");
    assert_announced_once(&mut bench, "Fuel cell error 32");
}

#[test]
fn large_fuel_cell_of_protocol_4_is_recognised() {
    let mut bench = with_generator(LARGE_FUEL_CELL);
    report(&mut bench, &protocol_4("48,6.1,49.9,1200,1300,0,-499,2,0,0,"), 6);
    of_pack(&mut bench, 1, |status| {
        assert_eq!((status.voltage_mv(0), status.current_ca()), (49_900, 1000));
    });
    of_pack(&mut bench, 2, |status| assert_eq!(status.remaining_pct(), 48));
}

#[test]
// Requirement: S-2
fn small_fuel_cell_has_shares_of_battery_and_tank() {
    let mut bench = with_generator(SMALL_FUEL_CELL);
    report(&mut bench, b"<76,91,2,0x0>\n", 6);
    of_pack(&mut bench, 1, |status| {
        assert_eq!((status.remaining_pct(), status.voltage_mv(0)), (91, u16::MAX));
    });
    of_pack(&mut bench, 2, |status| assert_eq!(status.remaining_pct(), 76));
}

#[test]
// Requirement: AP-9
fn richen_power_has_an_output_and_no_tank() {
    let mut bench = with_generator(RICHEN_POWER);
    report(&mut bench, &richen_power(0, 4995, 1234), 6);
    of_pack(&mut bench, 1, |status| {
        assert_eq!((status.voltage_mv(0), status.current_ca()), (49_950, 1234));
    });
    report(&mut bench, &richen_power(0x10, 4381, 0), 6);
    assert_announced_once(&mut bench, "Generator: low battery voltage");
    assert_announced_once(&mut bench, "Battery 3 unhealthy: port not set up");
    of_pack(&mut bench, 1, |status| {
        assert_eq!(status.voltage_mv(0), 43_810);
        assert_ne!(status.charge_state(), UNHEALTHY);
    });
}

#[test]
fn pack_whose_protocol_is_not_set_leaves_the_port_alone() {
    let mut bench = with_generator(0.0);
    send(&mut bench, b"<76,91,2,0x0>\n");
    bench.run_for(3 * SECOND);
    for pack in [2, 3] {
        assert_announced_once(&mut bench, &format!("Battery {pack} unhealthy: port not set up"));
    }
    assert_eq!(bench.uart(1).programmed_bit(), None);
}
