//! The board at a USB host: what hosts do, and what they do to it.

use emulator::{AbortPoint, ControlRequest, FlashTiming, LogLevel, Random, Reading};
use support::commands::PREFLIGHT_STORAGE;
use support::frames::{BATTERY_STATUS, Frame, HEARTBEAT, SYS_STATUS, assert_no_sequence_gap, of_message};
use support::requests::{VEHICLE, command_long, param_request_list};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, PARAMETER_BYTES, SECOND, TestedVehicle, Wire};

/// How long a program on the host has to do without its link, at most.
const BACK_WITHIN_US: u64 = 2 * SECOND;

/// Frames that are due together leave one after the other.
const UART_JITTER_US: u64 = 12 * MILLISECOND;

const REBUILT: &str = "USB: stuck";
const NOT_FETCHED: &str = "USB: link too slow";

/// Every transfer that can leave the driver waiting: for its status, for its data, and for the data to be fetched.
const ABORTS: [(ControlRequest, AbortPoint); 4] = [
    (ControlRequest::Close, AbortPoint::BeforeStatus),
    (ControlRequest::SetLineCoding, AbortPoint::BeforeData),
    (ControlRequest::SetLineCoding, AbortPoint::BeforeStatus),
    (ControlRequest::GetLineCoding, AbortPoint::BeforeData),
];

/// A board that runs, with a program at a host that has its port open; what has left the UART since is kept.
fn opened() -> Bench {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.run_until_silent();
    bench.use_wire(Wire::Usb);
    bench
}

fn rebuilds(bench: &Bench) -> usize {
    bench.logged(LogLevel::Warn, REBUILT).len()
}

/// Panics unless a whole frame comes through the port in time, and an answer after it. Returns how long the frame took.
fn assert_back(bench: &mut Bench, trouble: &str) -> u64 {
    let from_us = bench.time_us();
    bench.forget_sent();
    while bench.frames().is_empty() {
        let waited_us = bench.time_us() - from_us;
        assert!(
            waited_us < BACK_WITHIN_US,
            "no frame {waited_us} us after {trouble}: {:?}",
            bench.usb().take_events()
        );
        bench.run_for(10 * MILLISECOND);
    }
    let took_us = bench.time_us() - from_us;
    assert!(bench.usb().is_open(), "{trouble}");
    assert!(bench.read_parameter("BATT_LOW_VOLT").is_some(), "{trouble}");
    took_us
}

/// Panics unless each stream left the UART at its rate, and no frame is missing.
fn assert_uart_undisturbed(frames: &[Frame]) {
    assert_no_sequence_gap(frames);
    for (message, interval_us) in [
        (HEARTBEAT, SECOND),
        (SYS_STATUS, SECOND / 2),
        (BATTERY_STATUS, SECOND / 2),
    ] {
        for pair in of_message(frames, message).windows(2) {
            let off_us = (pair[1].at_us - pair[0].at_us).abs_diff(interval_us);
            let at_us = pair[1].at_us;
            assert!(
                off_us <= UART_JITTER_US,
                "message {message} at {at_us} us is {off_us} us off"
            );
        }
    }
}

/// Panics if there was a warning but for the device being rebuilt, and for telemetry that the host did not fetch.
fn assert_nothing_else(bench: &Bench) {
    let mut warnings = bench.logged(LogLevel::Warn, "");
    warnings.retain(|(_, text)| !text.contains(REBUILT) && !text.contains(NOT_FETCHED));
    assert!(warnings.is_empty(), "{warnings:?}");
    assert!(bench.resets().is_empty() && bench.bus_errors().is_empty());
}

#[test]
fn a_host_enumerates_the_board_and_gets_its_serial_number() {
    let mut seen = Vec::new();
    for seed in [1, 2, 1] {
        let mut bench = Bench::power_up_seeded(DIVIDER_CODE, seed);
        bench.run_for(SECOND);
        bench.use_wire(Wire::Usb);
        let device = bench.usb().device().cloned().expect("it is configured");
        assert_eq!((device.vendor, device.product), (0x2e8a, 0x000a));
        assert_eq!(device.manufacturer_name, "rover-battmon");
        assert_eq!(device.product_name, "rover-battmon MAVLink");
        let serial_number = device.serial_number;
        assert_eq!(serial_number.len(), 16);
        assert_eq!(bench.logged(LogLevel::Info, &serial_number).len(), 1);
        bench.assert_untroubled();
        seen.push(serial_number);
    }
    assert_ne!(seen[0], seen[1], "two boards");
    assert_eq!(seen[0], seen[2], "the same board");
}

/// Not all of an enumeration: each time the next packet is hit.
#[test]
// Requirement: R-3
fn a_bus_error_while_the_host_enumerates_the_board() {
    for after_us in [150, 160, 230, 235, 240, 245, 250].map(|ms| ms * MILLISECOND) {
        let mut bench = Bench::running(DIVIDER_CODE);
        bench.run_until_silent();
        bench.uart_frames();
        bench.usb().plug();
        bench.usb().open();
        bench.run_for(after_us);
        bench.usb().corrupt_next_packet();
        bench.use_wire(Wire::Usb);
        assert_back(&mut bench, &format!("a bus error {after_us} us after the cable"));
        assert_eq!(rebuilds(&bench), 1);
        assert_uart_undisturbed(&bench.uart_frames());
        assert_nothing_else(&bench);
    }
}

#[test]
// Requirement: R-3
fn a_hundred_opens_and_closes_with_aborts_and_bus_errors() {
    let mut bench = opened();
    let mut random = Random::new(14);
    let mut slowest_us = 0;
    let mut broken = 0;
    for round in 0..100 {
        let trouble = match random.below(3) {
            0 => {
                bench.usb().close();
                "a close".to_string()
            }
            1 => {
                let (request, point) = random.pick(&ABORTS);
                bench.usb().close_with_abort(request, point);
                broken += 1;
                format!("{request:?} dropped {point:?}")
            }
            _ => {
                bench.usb().corrupt_next_packet();
                // Something is on its way when it comes.
                bench.send(&param_request_list(VEHICLE));
                broken += 1;
                "a bus error".to_string()
            }
        };
        bench.run_for(MILLISECOND * (1 + random.below(100) as u64));
        if !bench.usb().is_open() {
            bench.usb().open();
        }
        let took_us = assert_back(&mut bench, &format!("{trouble} in round {round}"));
        slowest_us = slowest_us.max(took_us);
    }
    println!("{broken} times broken; slowest {slowest_us} us");
    assert_eq!(rebuilds(&bench), broken);
    assert_uart_undisturbed(&bench.uart_frames());
    assert_nothing_else(&bench);
}

#[test]
fn a_cable_pulled_while_sending_and_plugged_in_again() {
    let mut bench = opened();
    for pulled_after_us in [100, 3_000, 47_000, 500_000] {
        bench.send(&param_request_list(VEHICLE));
        bench.run_for(pulled_after_us);
        bench.usb().unplug();
        bench.run_for(2 * SECOND);
        bench.usb().plug();
        assert_back(&mut bench, "plugged in again");
    }
    assert_uart_undisturbed(&bench.uart_frames());
    bench.assert_untroubled();
}

/// Without the watch a new cable would not help.
#[test]
fn a_cable_pulled_in_the_middle_of_a_transfer_and_plugged_in_again() {
    for (request, point) in ABORTS {
        let mut bench = opened();
        bench.usb().request(request, Some(point));
        bench.run_for(5 * MILLISECOND);
        bench.usb().unplug();
        bench.run_for(3 * SECOND);
        bench.usb().plug();
        assert_back(&mut bench, &format!("pulled in {request:?} {point:?}"));
        assert_eq!(rebuilds(&bench), 1, "{request:?} {point:?}");
        assert_uart_undisturbed(&bench.uart_frames());
        assert_nothing_else(&bench);
    }
}

#[test]
fn a_board_that_gets_its_power_from_the_host_has_its_link_a_second_later() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.usb().plug();
    bench.usb().open();
    assert!(bench.run_until(SECOND, |board| board.usb().is_open()));
    bench.run_for(10 * SECOND);
    bench.assert_untroubled();
}

#[test]
fn a_program_that_never_reads_disturbs_neither_uart_nor_device() {
    let mut bench = opened();
    bench.usb().set_reading(Reading::Stalls);
    bench.send(&param_request_list(VEHICLE));
    bench.run_for(30 * SECOND);
    assert_uart_undisturbed(&bench.uart_frames());
    bench.usb().set_reading(Reading::Reads);
    assert_back(&mut bench, "it reads again");
    assert_eq!(rebuilds(&bench), 0);
    assert_nothing_else(&bench);
}

/// Nothing runs during an erase, the watch included, while the host goes on asking.
#[test]
fn the_slowest_erase_is_no_fault_of_the_device() {
    // Nothing there can be kept, so the first value that is written needs an erased sector.
    let mut bench = Bench::power_up_with_parameters(DIVIDER_CODE, &[0; PARAMETER_BYTES]);
    bench.flash_timing(FlashTiming::MAXIMUM);
    // The mark of the damage, and a sector erased ahead.
    bench.run_for(5 * SECOND);
    bench.use_wire(Wire::Usb);
    // A reset moves to that sector, and the next one is erased.
    bench.send(&command_long(PREFLIGHT_STORAGE, 2.0));
    for _ in 0..200 {
        bench.usb().request(ControlRequest::GetLineCoding, None);
        bench.run_for(10 * MILLISECOND);
    }
    assert!(!bench.flash_erase_counts().is_empty());
    assert_eq!(rebuilds(&bench), 0);
    assert_back(&mut bench, "an erase");
}

#[test]
fn a_bus_reset_and_a_suspended_bus_are_no_fault_of_the_device() {
    let mut bench = opened();
    bench.usb().reset_bus();
    assert_back(&mut bench, "a bus reset");
    bench.usb().suspend();
    bench.run_for(20 * SECOND);
    bench.usb().resume();
    assert_back(&mut bench, "a resume");
    bench.usb().suspend();
    bench.run_for(5 * SECOND);
    bench.usb().reset_bus();
    assert_back(&mut bench, "a bus reset that ends a suspend");
    assert_uart_undisturbed(&bench.uart_frames());
    bench.assert_untroubled();
}
