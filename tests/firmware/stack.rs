//! How deep the stack gets, interrupts included, when everything happens at once.

use crate::signing;
use crate::wheels::duties;
use emulator::{AdcFault, LogLevel, ResetCause};
use support::commands::{ACCEPTED, BATTERY_RESET, REQUEST_MESSAGE};
use support::frames::{PARAM_VALUE, of_message};
use support::motor_poles::LEFT;
use support::requests::{
    VEHICLE, VEHICLE_ID, arm_by_force, command_int, command_long, command_long_2, ftp_open, manual_control,
    manual_mode, param_request_list, param_set, ping, timesync,
};
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle};
use workbench::i2c_bus::BUS;
use workbench::runs::mixed_packs;

/// Of the stack's room, this much has to be free at the worst.
const FREE_PERCENT: u32 = 30;

const AUTOPILOT_VERSION: f32 = 148.0;

/// Nine packs, each with a message of its own 50 times a second, on the fastest line there is, all signed.
fn busiest_board() -> Bench {
    let mut bench = signing::open_with_key();
    // The restart at the end is the start that is looked at.
    bench.forget_stack_use();
    mixed_packs::plug_in(&mut bench);
    bench.set_all(&mixed_packs::MIXED);
    bench.set_all(&[("SR0_EXTRA1", 50.0), ("SERIAL0_BAUD", 921.0)]);
    bench.reboot();
    // The frame that the restart has cut is no frame.
    bench.run_until_silent();
    bench.forget_sent();
    bench
}

fn arm(bench: &mut Bench) {
    assert_eq!(bench.result_of(&arm_by_force()), ACCEPTED);
    bench.ask(&manual_mode());
}

/// What ground stations ask for in one second, the longest answers and writes to flash among it.
fn requests(round: u16) -> Vec<Vec<u8>> {
    vec![
        param_request_list(VEHICLE),
        param_set("BATT_LOW_VOLT", 6.0 + 0.1 * f32::from(round)),
        param_set("BATT9_CAPACITY", 1000.0 + f32::from(round)),
        command_long(REQUEST_MESSAGE, AUTOPILOT_VERSION),
        command_int(BATTERY_RESET, 0.0),
        command_long_2(BATTERY_RESET, 511.0, 50.0),
        ftp_open(round, "@PARAM/param.pck"),
        ping(u64::from(round), 1),
        timesync(i64::from(round)),
    ]
}

/// Ground stations send requests, and one drives.
fn load_for(bench: &mut Bench, seconds: u16) {
    let mut owner = signing::station(bench);
    for round in 0..seconds {
        for (number, request) in requests(round).into_iter().enumerate() {
            let now_us = bench.time_us();
            let free_us = bench.uart_send(0, now_us, &owner.sign(&request));
            // Centred once a second, after which the rover drives.
            let [steering, throttle] = if number == 0 { [0, 0] } else { [200, 600] };
            let sticks = owner.sign(&manual_control(VEHICLE_ID, steering, throttle));
            bench.uart_send(0, free_us, &sticks);
            bench.run_for(100 * MILLISECOND);
        }
    }
}

/// Panics unless enough of the stack stayed free since the last call.
pub fn assert_free(bench: &mut Bench, during: &str) {
    let (used, room) = (bench.stack_used_bytes(), bench.stack_bytes());
    let written = bench.stack_painted_over_bytes();
    let free_percent = 100 * room.saturating_sub(used) / room;
    let stack = format!("{used:6} of {room} bytes of stack used, {written:6} of them written");
    println!("{stack}, {free_percent} % free: {during}");
    assert!(free_percent >= FREE_PERCENT, "{stack}: {during}");
    assert!((1..=used).contains(&written), "{stack}: {during}");
    bench.forget_stack_use();
}

#[test]
fn three_tenths_of_the_stack_stay_free_under_the_heaviest_load() {
    let mut bench = busiest_board();
    assert_free(&mut bench, "start with nine packs");

    arm(&mut bench);
    let from_us = bench.time_us();
    load_for(&mut bench, 6);
    assert!(duties(LEFT[0], &bench).0 > 0.3, "the motors stand");
    let frames = bench.frames();
    let values = of_message(&frames, PARAM_VALUE).into_iter();
    let listed = values.filter(|frame| frame.at_us > from_us).count();
    assert!(listed > 300, "{listed} parameters were sent");
    assert_free(
        &mut bench,
        "nine packs at 50 Hz, requests, writes to flash, motors",
    );

    bench.plug_usb();
    bench.usb().send(&param_request_list(VEHICLE));
    load_for(&mut bench, 3);
    bench.usb().corrupt_next_packet();
    load_for(&mut bench, 3);
    assert!(bench.usb().is_open());
    assert_eq!(bench.logged(LogLevel::Warn, "USB: stuck").len(), 1);
    assert_free(
        &mut bench,
        "the same with a second ground station by USB, once rebuilt",
    );

    bench.adc_fault(AdcFault::Stalled);
    bench.i2c(BUS).hold_sda(u32::MAX);
    load_for(&mut bench, 6);
    assert!(!bench.logged(LogLevel::Warn, "read failed").is_empty());
    assert_free(&mut bench, "the same with a dead converter and a dead bus");

    let reset = bench.reset_by(2 * SECOND, Bench::panic);
    assert_eq!(reset.cause, ResetCause::WatchdogForce);
    assert!(!bench.logged(LogLevel::Error, "panicked").is_empty());
    assert_free(&mut bench, "a panic and its HardFault");
    bench.run_for(2 * SECOND);
    assert_free(&mut bench, "start after it, with what was retained");
}
