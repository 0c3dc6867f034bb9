//! What faults do, all of them put in from outside.

use crate::rover::GOOD_3S;
use emulator::{AdcFault, AdcInput, LogLevel};
use support::charge_states::{OK, UNHEALTHY};
use support::frames::{HEARTBEAT, last_of, of_message};
use support::requests::arm;
use workbench::bench::{Bench, MILLISECOND, PACK, SECOND, STACK_POINTER, TestedVehicle};

/// Sampling ticks fall on whole tenths of a second after boot; this is between two of them.
const BETWEEN_TICKS_US: u64 = 5_050 * MILLISECOND;

#[test]
// Requirement: FR-12
fn a_converter_that_fails_is_noticed_and_read_again() {
    for (fault, named) in [
        (AdcFault::Stalled, "Timeout"),
        (AdcFault::ConversionError, "Conversion"),
    ] {
        let mut bench = Bench::running(2482);
        bench.adc_fault(fault);
        // The tick after the one in which a converter stalls has none of its conversions.
        bench.run_for(SECOND + SECOND / 2);
        let failures = bench.logged(LogLevel::Warn, "read failed");
        assert!(failures[0].1.contains(named), "{failures:?}");
        assert_eq!(last_of(&bench.frames(), 0).charge_state(), UNHEALTHY);
        bench.adc_fault(AdcFault::None);
        bench.adc_input(PACK, AdcInput::Code(2600));
        bench.run_for(2 * SECOND);
        let frames = bench.frames();
        let status = last_of(&frames, 0);
        assert_eq!(status.charge_state(), OK);
        assert!(status.voltage_mv(0) > 8200);
        assert!(bench.resets().is_empty());
    }
}

/// Without bytes on any wire nothing but the timer wakes a task.
#[test]
// Requirement: R-18
fn an_alarm_of_the_timer_that_is_lost_while_armed_delays_the_tasks_by_20_ms_at_most() {
    const TIME_DRIVER: usize = 0;
    let mut bench = Bench::configured(GOOD_3S, &[("BATT_CELLS", 3.0)]);
    bench.ask(&arm());
    for moment_us in (0..20).map(|moment| 101_300 * moment) {
        bench.run_for(300 * MILLISECOND + moment_us);
        bench.run_until_silent();
        let lost_us = bench.time_us();
        bench.lose_timer_alarm(TIME_DRIVER);
        bench.run_for(SECOND + SECOND / 2);
        bench.run_until_silent();
        let beats = of_message(&bench.frames_since(lost_us), HEARTBEAT).len();
        assert!((1..=2).contains(&beats), "{beats} after {lost_us}");
    }
    assert_eq!(bench.resets().len(), 1, "{:?}", bench.resets());
}

/// The datasheet does not say what answers below RAM.
#[test]
// Requirement: R-6
fn a_stack_overflow_harms_no_data_and_ends_in_a_reset_without_a_bus_error_below_ram_too() {
    let mut bench = Bench::power_up(2482);
    bench.answer_below_ram();
    bench.run_until_time(BETWEEN_TICKS_US);
    let stack = bench.symbol("_stack_end")..bench.symbol("_stack_start");
    let is_there = stack.contains(&bench.register(STACK_POINTER));
    assert!(is_there, "the stack is elsewhere: {stack:x?}");
    let contents = |bench: &Bench| {
        [".data", ".bss", ".uninit"].map(|name| {
            let section = bench.section(name);
            bench.read_memory(section.start, section.len())
        })
    };
    let before = contents(&bench);
    // The next interrupt's frame no longer fits.
    bench.set_register(STACK_POINTER, stack.start + 8);
    let is_locked_up = bench.run_until(SECOND, |board| board.is_locked_up());
    assert!(is_locked_up, "{:x?}", bench.bus_errors());
    assert!(contents(&bench) == before, "data changed");

    bench.reset_by(1_050 * MILLISECOND, |_| ());
    let [.., uninit_before] = before;
    let [.., uninit_after] = contents(&bench);
    assert!(uninit_after == uninit_before, ".uninit did not survive the reset");
    bench.run_for(SECOND);
    let started = bench.logged(LogLevel::Info, "started by WatchdogTimeout");
    assert_eq!(started.len(), 1);
}
