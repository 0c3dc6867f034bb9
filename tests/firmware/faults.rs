//! What faults do, all of them put in from outside.

use emulator::{AdcFault, AdcInput, LogLevel, ResetCause};
use support::charge_states::{OK, UNHEALTHY};
use support::frames::{BATTERY_STATUS, BatteryStatus, HEARTBEAT, SYS_STATUS, SysStatus, of_message};
use workbench::bench::{Bench, DMA_IRQ, MILLISECOND, PACK, SECOND, STACK_POINTER};

/// Sampling ticks fall on whole tenths of a second after boot; this is between two of them.
const BETWEEN_TICKS_US: u64 = 5_050 * MILLISECOND;

/// Frames that arrive this long after something was known may have been built before.
const ON_ITS_WAY_US: u64 = 12 * MILLISECOND;

fn a_failing_converter_keeps_the_last_value(
    fail: impl Fn(&mut Bench),
    mend: impl Fn(&mut Bench),
    named: &str,
) {
    let mut bench = Bench::power_up(2482);
    bench.run_until_time(BETWEEN_TICKS_US);
    fail(&mut bench);
    // If a new voltage came through all the same, it would show.
    bench.adc_input(PACK, AdcInput::Code(2600));
    bench.run_until_time(10 * SECOND);

    let failures = bench.logged(LogLevel::Warn, "read failed");
    // Of 49 failures the five until it is unhealthy, and then one a second: the 10th, 20th, 30th and 40th.
    assert_eq!(failures.len(), 5 + 4, "{named}");
    assert!(failures[0].1.contains(named), "{failures:?}");
    let unhealthy = bench.logged(LogLevel::Warn, "unhealthy");
    assert_eq!(unhealthy.len(), 1, "said once");
    assert!(
        failures[4].0 <= unhealthy[0].0 && unhealthy[0].0 < failures[5].0,
        "after the fifth"
    );

    let frames = bench.frames();
    let battery = of_message(&frames, BATTERY_STATUS);
    assert_eq!(battery.len(), 20, "telemetry goes on");
    for frame in &battery[1..] {
        let status = BatteryStatus(frame);
        assert_eq!(
            status.voltage_mv(0),
            7901,
            "the last good value at {} us",
            frame.at_us
        );
        if frame.at_us < unhealthy[0].0 {
            assert_eq!(status.charge_state(), OK, "at {} us", frame.at_us);
        } else if frame.at_us > unhealthy[0].0 + ON_ITS_WAY_US {
            assert_eq!(status.charge_state(), UNHEALTHY, "at {} us", frame.at_us);
        }
    }
    let sys_status = of_message(&frames, SYS_STATUS);
    assert!(!SysStatus(sys_status[sys_status.len() - 1]).is_battery_healthy());

    mend(&mut bench);
    bench.run_for(2 * SECOND);
    let frames = bench.frames();
    let battery = of_message(&frames, BATTERY_STATUS);
    let last = BatteryStatus(battery[battery.len() - 1]);
    assert_eq!(last.charge_state(), OK);
    assert!(last.voltage_mv(0) > 8200);
    assert!(bench.resets().is_empty());
}

#[test]
// Requirement: FR-12
fn a_converter_that_never_finishes() {
    a_failing_converter_keeps_the_last_value(
        |bench| bench.adc_fault(AdcFault::Stalled),
        |bench| bench.adc_fault(AdcFault::None),
        "Timeout",
    );
}

#[test]
fn a_converter_that_reports_errors() {
    a_failing_converter_keeps_the_last_value(
        |bench| bench.adc_fault(AdcFault::ConversionError),
        |bench| bench.adc_fault(AdcFault::None),
        "Conversion",
    );
}

/// Panics unless a reset of this cause ended what happened at `since_us` in time, the log names the reason, and telemetry
/// is back.
fn assert_reset(bench: &mut Bench, since_us: u64, within_us: u64, cause: ResetCause, reason: &str) {
    assert!(
        bench.run_until(within_us, |board| !board.resets().is_empty()),
        "no reset within {within_us} us"
    );
    let reset = bench.resets()[0];
    assert_eq!(reset.cause, cause);
    println!(
        "reset {:.1} ms after the fault",
        (reset.time_us - since_us) as f64 / 1000.0
    );

    let restarted_us = bench.time_us();
    // What was on the wire at the reset is cut off; the first heartbeat leaves meanwhile.
    bench.run_for(30 * MILLISECOND);
    assert_eq!(
        bench
            .logged(LogLevel::Info, &format!("started by {reason}"))
            .len(),
        1,
        "{:?}",
        bench.log_lines()
    );
    bench.run_for(3 * SECOND);
    let frames = bench.frames_since(restarted_us);
    assert_eq!(of_message(&frames, HEARTBEAT).len(), 4);
    assert_eq!(bench.resets().len(), 1, "one reset is enough");
}

#[test]
fn a_hung_program_is_reset_and_the_reason_logged() {
    let mut bench = Bench::power_up(2482);
    bench.run_until_time(BETWEEN_TICKS_US);
    bench.hang_program();
    assert_reset(
        &mut bench,
        BETWEEN_TICKS_US,
        1_050 * MILLISECOND,
        ResetCause::WatchdogTimer,
        "WatchdogTimeout",
    );
}

#[test]
fn an_undefined_instruction_ends_in_a_reset_at_once() {
    let mut bench = Bench::power_up(2482);
    bench.run_until_time(BETWEEN_TICKS_US);
    bench.run_undefined_instruction();
    assert_reset(
        &mut bench,
        BETWEEN_TICKS_US,
        MILLISECOND,
        ResetCause::WatchdogForce,
        "Fault",
    );
}

#[test]
fn a_task_that_waits_for_ever_is_named_and_ends_in_a_reset() {
    let mut bench = Bench::power_up(2482);
    bench.run_until_time(BETWEEN_TICKS_US);
    bench.cut_interrupt(DMA_IRQ);
    // The next frame never ends; 2.5 s later the writer is overdue; then the watchdog's second.
    assert!(bench.run_until(5 * SECOND, |board| !board.resets().is_empty()));
    assert_eq!(bench.resets()[0].cause, ResetCause::WatchdogTimer);
    assert!(
        !bench
            .logged(LogLevel::Warn, "task UART0 writer is overdue")
            .is_empty()
    );

    bench.restore_interrupt(DMA_IRQ);
    let restarted_us = bench.time_us();
    bench.run_for(3 * SECOND);
    assert_eq!(of_message(&bench.frames_since(restarted_us), HEARTBEAT).len(), 3);
    assert_eq!(bench.resets().len(), 1);
}

#[test]
fn a_healthy_firmware_feeds_the_watchdog_long_before_its_time() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(60 * SECOND);
    assert!(bench.watchdog_is_enabled());
    let slack_us = bench.smallest_watchdog_slack_us().expect("it was fed");
    assert!(slack_us > 850 * MILLISECOND, "{slack_us} us");
}

/// Uses up the stack, so that the next interrupt's frame no longer fits.
fn overflow_the_stack(bench: &mut Bench) {
    bench.run_until_time(BETWEEN_TICKS_US);
    let stack = bench.symbol("_stack_end")..bench.symbol("_stack_start");
    assert!(
        stack.contains(&bench.register(STACK_POINTER)),
        "the stack is elsewhere: {stack:x?}"
    );
    let contents = |bench: &Bench| {
        [".data", ".bss", ".uninit"].map(|name| {
            let section = bench.section(name);
            bench.read_memory(section.start, section.len())
        })
    };
    let before = contents(bench);
    bench.set_register(STACK_POINTER, stack.start + 8);
    assert!(
        bench.run_until(SECOND, |board| board.is_locked_up()),
        "{:x?}",
        bench.bus_errors()
    );
    assert!(contents(bench) == before, "data changed");

    assert!(bench.run_until(1_050 * MILLISECOND, |board| !board.resets().is_empty()));
    let [.., uninit_before] = before;
    let [.., uninit_after] = contents(bench);
    assert!(uninit_after == uninit_before, ".uninit did not survive the reset");
    bench.run_for(SECOND);
    assert_eq!(
        bench.logged(LogLevel::Info, "started by WatchdogTimeout").len(),
        1
    );
}

#[test]
fn a_stack_overflow_harms_no_data_and_ends_in_a_reset() {
    overflow_the_stack(&mut Bench::power_up(2482));
}

/// The datasheet does not say what answers below RAM.
#[test]
// Requirement: R-6
fn a_stack_overflow_ends_so_without_a_bus_error_below_ram_too() {
    let mut bench = Bench::power_up(2482);
    bench.answer_below_ram();
    overflow_the_stack(&mut bench);
}
