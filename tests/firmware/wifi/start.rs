//! From power-up to the first heartbeat by Wi-Fi, and what a board without a radio notices of it.

use super::ground::Ground;
use emulator::{AdcInput, LogLevel, RadioFault};
use support::frames::{HEARTBEAT, of_message, texts_of};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle};

/// Everything that a Pico W has its radio at, and a plain Pico something else.
const RADIO_PINS: [usize; 4] = [23, 24, 25, 29];

/// Panics if one of them is driven, at any of 200 looks.
fn assert_radio_pins_are_free(bench: &mut Bench, between_looks_us: u64) {
    for _ in 0..200 {
        bench.run_for(between_looks_us);
        assert_eq!(RADIO_PINS.map(|pin| bench.pin_level(pin)), [None; 4]);
    }
}

/// When the first HEARTBEAT has left the telemetry port.
fn first_heartbeat_us(bench: &mut Bench) -> u64 {
    of_message(&bench.uart_frames(), HEARTBEAT)[0].at_us
}

#[test]
fn the_network_and_the_first_heartbeat_in_it_are_there_within_three_seconds() {
    let mut ground = Ground::up();
    let up_us = ground.bench.time_us();
    let laptop = ground.laptop();
    let mut station = ground.listen(laptop);
    let frames = ground.hear_for(&mut station, SECOND + SECOND / 2);
    let first_us = of_message(&frames, HEARTBEAT)[0].at_us;
    println!("network up after {up_us} us, first heartbeat heard after {first_us} us");
    assert!(first_us <= 3 * SECOND, "{first_us}");
    ground.bench.assert_untroubled();

    // The telemetry port does not wait for the radio.
    let with_radio_us = first_heartbeat_us(&mut ground.bench);
    let mut plain = Bench::power_up(DIVIDER_CODE);
    plain.run_for(SECOND / 2);
    let without_us = first_heartbeat_us(&mut plain);
    println!("first heartbeat by the telemetry port: {with_radio_us} us, {without_us} us without a radio");
    assert!(with_radio_us.abs_diff(without_us) <= 5 * MILLISECOND);
}

/// A USB-C host switches its supply on only if it finds none at the port, where the radio's pull-up would leave 1.4 V.
#[test]
// Requirement: R-17
fn the_radios_pin_at_the_usb_supply_is_low_and_the_one_at_the_regulator_high() {
    let mut ground = Ground::up();
    let wifi = ground.bench.wifi();
    assert_eq!(
        [0, 1, 2].map(|gpio| wifi.gpio(gpio)),
        [None, Some(true), Some(false)]
    );
}

#[test]
// Requirement: R-19
fn a_radio_that_is_off_is_held_off() {
    const POWER: usize = 23;
    let mut ground = Ground::up();
    assert_eq!(ground.bench.pin_level(POWER), Some(true));
    ground.bench.set("WIFI_MODE", 0.0);
    ground.bench.run_for(3 * SECOND);
    for _ in 0..50 {
        ground.bench.run_for(100 * MILLISECOND);
        assert_eq!(ground.bench.pin_level(POWER), Some(false));
    }
}

#[test]
// Requirement: R-9
fn a_plain_pico_leaves_the_pins_alone_that_a_pico_w_has_its_radio_at() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    assert!(bench.run_until(SECOND / 10, |board| !board.log_lines().is_empty()));
    assert_radio_pins_are_free(&mut bench, 10 * MILLISECOND);
    assert_eq!(bench.logged(LogLevel::Info, "Wi-Fi radio: Absent").len(), 1);
    assert_eq!(bench.logged(LogLevel::Info, "Wi-Fi").len(), 1);
    bench.assert_untroubled();
}

#[test]
// Requirement: R-9
fn a_board_with_neither_radio_nor_divider_has_gp29_as_a_pin_after_three_vain_starts_and_a_restart() {
    const GP29: usize = 3;
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.adc_input(GP29, AdcInput::Code(0));
    bench.run_for(32 * SECOND);
    let mut said = texts_of(&bench.frames());
    said.retain(|text| text.contains("Wi-Fi"));
    let given_up = "No Wi-Fi radio found: GP29 free after a restart";
    assert_eq!(said, ["Wi-Fi radio does not answer", given_up]);
    assert_radio_pins_are_free(&mut bench, 100 * MILLISECOND);
    bench.reboot();
    bench.adc_input(GP29, AdcInput::Code(DIVIDER_CODE));
    bench.set("BATT_VOLT_PIN", 29.0);
    bench.run_for(2 * SECOND);
    let taken = bench.logged(LogLevel::Info, "GP29 is the Wi-Fi radio's");
    assert!(taken.is_empty(), "{taken:?}");
    assert_eq!(bench.logged(LogLevel::Info, "Wi-Fi radio: Present").len(), 1);
    assert_eq!(bench.logged(LogLevel::Info, "Wi-Fi radio: Absent").len(), 1);

    bench.adc_input(GP29, AdcInput::Code(0));
    bench.power_cycle();
    bench.run_for(SECOND);
    assert_eq!(bench.logged(LogLevel::Info, "Wi-Fi radio: Present").len(), 2);
}

#[test]
// Requirement: R-9
fn a_charge_on_the_floating_pin_hides_no_radio() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.attach_wifi();
    // Its chip does not pull GP25 up yet.
    bench.wifi().set_fault(Some(RadioFault::Missing));
    bench.float_vsys_pin(3.0);
    bench.run_for(SECOND);
    assert_eq!(bench.logged(LogLevel::Info, "Wi-Fi radio: Present").len(), 1);
}

#[test]
// Requirement: R-9
fn a_radio_that_wakes_up_late_is_found() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.attach_wifi();
    bench.wifi().set_fault(Some(RadioFault::Missing));
    bench.run_for(20 * SECOND);
    bench.wifi().set_fault(None);
    let mut ground = Ground::around(bench);
    ground.wait_for_network(15 * SECOND);
    // One that has answered once is not given up.
    ground.bench.wifi().set_fault(Some(RadioFault::Missing));
    ground.run_for(60 * SECOND);
    ground.bench.wifi().set_fault(None);
    ground.wait_for_network(15 * SECOND);
    ground.assert_not_reset();
}
