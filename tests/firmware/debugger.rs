//! What a debug probe does to a running board: it halts cores, and its cable is pulled.

use crate::rover::{GOOD_3S, drive_for, is_coasting};
use emulator::ResetCause;
use support::frames::{HEARTBEAT, of_message};
use support::requests::{arm, manual_mode};
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle};
use workbench::rover_circuit::{THREE_CELLS_V, connect};

const CORE_0: u32 = 0b01;
const CORE_1: u32 = 0b10;
const NONE: u32 = 0;

/// Its watchdog's second and a little more.
const RESET_WITHIN_US: u64 = 1_050 * MILLISECOND;

fn driving() -> Bench {
    let mut bench = Bench::configured(GOOD_3S, &[("BATT_CELLS", 3.0)]);
    connect(&mut bench, THREE_CELLS_V);
    bench.ask(&arm());
    bench.ask(&manual_mode());
    drive_for(&mut bench, SECOND / 10, 0);
    drive_for(&mut bench, SECOND, 500);
    assert!(!is_coasting(&bench));
    bench
}

#[test]
// Requirement: R-2
fn a_rover_whose_processor_is_halted_stands_within_a_second() {
    let mut bench = driving();
    let reset = bench.reset_by(RESET_WITHIN_US, |bench| bench.halt_cores(CORE_0));
    assert_eq!(reset.cause, ResetCause::WatchdogTimer);
    assert!(is_coasting(&bench));
}

#[test]
// Requirement: R-2
fn a_short_halt_resets_nothing_and_the_time_goes_on() {
    let mut bench = Bench::running(GOOD_3S);
    let from_us = bench.time_us();
    for _ in 0..5 {
        bench.halt_cores(CORE_0);
        bench.run_for(600 * MILLISECOND);
        bench.halt_cores(NONE);
        bench.run_for(400 * MILLISECOND);
    }
    bench.run_until_silent();
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
    let heartbeats = of_message(&bench.frames_since(from_us), HEARTBEAT).len();
    assert!((5..=6).contains(&heartbeats), "{heartbeats} in five seconds");
}

#[test]
// Requirement: R-2
fn a_halted_core_1_stops_neither_time_nor_watchdog() {
    let mut bench = Bench::running(GOOD_3S);
    bench.halt_cores(CORE_1);
    let from_us = bench.time_us();
    bench.run_for(5 * SECOND);
    let heartbeats = of_message(&bench.frames_since(from_us), HEARTBEAT).len();
    assert_eq!(heartbeats, 5);
    assert!(bench.resets().is_empty());
    let reset = bench.reset_by(RESET_WITHIN_US, |bench| bench.hang_program());
    assert_eq!(reset.cause, ResetCause::WatchdogTimer);
}

/// A host that reads the log has it block when its buffer is full.
#[test]
// Requirement: R-2
fn a_pulled_probe_cable_does_not_stop_the_firmware() {
    let mut bench = Bench::running(GOOD_3S);
    bench.pull_probe_cable();
    let from_us = bench.time_us();
    bench.run_for(60 * SECOND);
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
    assert_eq!(of_message(&bench.frames_since(from_us), HEARTBEAT).len(), 60);
    assert!(bench.smallest_watchdog_slack_us() > Some(850 * MILLISECOND));
}
