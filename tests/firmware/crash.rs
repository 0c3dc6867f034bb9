//! Crash records, and to which systems they are reported after the restart.

use emulator::{Board, LogLevel, ResetCause, UNDEFINED_INSTRUCTION};
use support::frames::{CRITICAL, STATUSTEXT, of_message, texts_of};
use support::requests::{
    GCS, ONBOARD_CONTROLLER, VEHICLE, arm_by_force, disarm, heartbeat, param_request_list,
};
use workbench::bench::{
    Bench, DIVIDER_CODE, DMA_IRQ, LINK_REGISTER, MILLISECOND, PROGRAM_COUNTER, RUNNING, SECOND, TestedVehicle,
};
use workbench::downloads::{download, list};
use workbench::log_records::{named, records};

/// Sampling ticks fall on whole tenths of a second after boot, the motors are set every 20 ms; this is between
/// two of either.
const BETWEEN_TICKS_US: u64 = 5_050 * MILLISECOND;

/// Before a turn of the drive task, and of no other.
const BEFORE_DRIVE_US: u64 = 5_070 * MILLISECOND;

/// A fault restarts the board without waiting for the watchdog.
const AT_ONCE_US: u64 = MILLISECOND;

/// The watchdog's time-out, and what it is late by at the most.
const TIMEOUT_US: u64 = 1_050 * MILLISECOND;

/// Address of the instruction a function returns to, as it stands on the stack: bit 0 stands for Thumb.
const THUMB: u32 = 1;

fn between_ticks() -> Bench {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.run_until_time(BETWEEN_TICKS_US);
    bench
}

/// In the middle of the task that runs next.
fn in_drive() -> Bench {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.run_until_time(BEFORE_DRIVE_US);
    bench.run_into_task();
    bench
}

/// Waits for a reset of this cause, and until the board runs again.
fn assert_reset(bench: &mut Bench, cause: ResetCause, within_us: u64) {
    let (since_us, resets) = (bench.time_us(), bench.resets().len());
    let reset = bench.reset_by(within_us, |_| ());
    assert_eq!(reset.cause, cause);
    println!("reset after {} us", reset.time_us - since_us);
    // What was on the wire at the reset is cut off.
    bench.run_for(500 * MILLISECOND);
    assert_eq!(bench.resets().len(), resets + 1, "one reset is enough");
}

/// What has been said of crashes since `from_us`, long texts in one.
fn said_since(bench: &mut Bench, from_us: u64) -> Vec<String> {
    let mut texts: Vec<String> = Vec::new();
    for frame in of_message(&bench.frames_since(from_us), STATUSTEXT) {
        let (severity, text, chunk) = (frame.u8(0), frame.text(1, 50), frame.u8(53));
        assert!(!text.starts_with("Crash") || severity == CRITICAL, "{text}");
        match texts.last_mut() {
            Some(last) if chunk > 0 => last.push_str(&text),
            _ => texts.push(text),
        }
    }
    texts.retain(|text| text.starts_with("Crash"));
    texts
}

/// What is said of crashes in the three seconds after a heartbeat of this kind of system.
fn said_to(bench: &mut Bench, kind: u8) -> Vec<String> {
    let from_us = bench.time_us();
    bench.uart_send(0, from_us, &heartbeat(kind));
    bench.run_for(3 * SECOND);
    said_since(bench, from_us)
}

/// The report to the first ground station. Panics if there is none to a link that opens, or one after the next arming.
fn reported(bench: &mut Bench) -> Vec<String> {
    let at_start = said_since(bench, 0);
    assert!(said_to(bench, ONBOARD_CONTROLLER).is_empty());
    let reported = said_to(bench, GCS);
    // Without addresses, until it is known which version runs.
    assert!(reported[0].starts_with(&at_start[0]), "{at_start:?}");
    assert!(said_to(bench, GCS).is_empty(), "once a station");
    bench.reboot();
    assert_eq!(said_to(bench, GCS)[0], reported[0], "it was not armed");
    arm_and_disarm(bench);
    bench.reboot();
    assert!(
        said_to(bench, GCS).is_empty(),
        "reported again after it was armed"
    );
    println!("{reported:?}");
    reported
}

fn arm_and_disarm(bench: &mut Bench) {
    bench.ask(&arm_by_force());
    bench.ask(&disarm());
}

fn assert_logged(bench: &Bench, text: &str) {
    let lines = bench.logged(LogLevel::Warn, text);
    assert_eq!(lines.len(), 1, "{text}: {:?}", bench.log_lines());
}

#[test]
// Requirement: OWN-6
fn an_undefined_instruction_is_reported_with_its_address_and_task() {
    let mut bench = in_drive();
    let link_register = bench.register(LINK_REGISTER);
    bench.run_undefined_instruction();
    assert_reset(&mut bench, ResetCause::WatchdogForce, AT_ONCE_US);
    let headline =
        format!("Crash: hard fault in drive, PC {UNDEFINED_INSTRUCTION:#010x} LR {link_register:#010x}");
    assert_logged(&bench, &headline);
    assert_logged(&bench, "xPSR 0x");
    assert_eq!(reported(&mut bench)[0], headline);
}

#[test]
fn a_panic_is_reported_with_its_callers() {
    let mut bench = in_drive();
    bench.panic();
    // The caller: any place in the program, as it stands in the link register.
    let caller = bench.symbol("main") & !THUMB;
    bench.set_register(LINK_REGISTER, caller + 4 + THUMB);
    assert_reset(&mut bench, ResetCause::WatchdogForce, AT_ONCE_US);
    assert!(!bench.logged(LogLevel::Error, "panicked").is_empty());
    let reported = said_to(&mut bench, GCS);
    assert!(
        reported[0].starts_with("Crash: hard fault in drive, PC 0x10"),
        "{reported:?}"
    );
    let calls = reported[1]
        .strip_prefix("Crash: called from ")
        .expect("the calls");
    let expected = format!("{:08x}", caller + 2);
    assert!(
        calls.split(' ').any(|call| call == expected),
        "{expected} is not in {calls}"
    );
}

#[test]
fn a_fault_in_an_interrupt_names_it() {
    const FIRST_INTERRUPT: u32 = 16;
    const TIMER_IRQ: u32 = 0;
    let mut bench = between_ticks();
    let is_in_timer = |board: &mut Board| board.active_exception() == FIRST_INTERRUPT + TIMER_IRQ;
    assert!(bench.run_until(SECOND, is_in_timer));
    bench.set_register(PROGRAM_COUNTER, UNDEFINED_INSTRUCTION);
    assert_reset(&mut bench, ResetCause::WatchdogForce, AT_ONCE_US);
    let reported = said_to(&mut bench, GCS);
    assert!(reported[0].ends_with(" in IRQ 0"), "{reported:?}");
}

#[test]
fn a_fault_before_the_watchdog_runs_restarts_the_board_too() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.run_undefined_instruction();
    assert_reset(&mut bench, ResetCause::WatchdogForce, AT_ONCE_US);
    assert!(said_to(&mut bench, GCS)[0].starts_with("Crash: hard fault in "));
}

#[test]
fn the_start_is_named_like_a_task() {
    // Parameters are being read.
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.run_for(4 * MILLISECOND);
    bench.hang_program();
    assert_reset(&mut bench, ResetCause::WatchdogTimer, TIMEOUT_US);
    assert_eq!(said_to(&mut bench, GCS), ["Crash: hung or locked up in main"]);
}

#[test]
fn a_task_that_never_yields_is_named() {
    let mut bench = in_drive();
    bench.hang_program();
    assert_reset(&mut bench, ResetCause::WatchdogTimer, TIMEOUT_US);
    assert_logged(&bench, "Crash: hung or locked up in drive");
    assert_eq!(said_to(&mut bench, GCS), ["Crash: hung or locked up in drive"]);
}

#[test]
fn a_task_that_waits_for_ever_is_named() {
    let mut bench = between_ticks();
    bench.cut_interrupt(DMA_IRQ);
    // The next frame never ends; 2.5 s later the writer is overdue; then the watchdog's second.
    assert!(bench.run_until(5 * SECOND, |board| !board.resets().is_empty()));
    bench.restore_interrupt(DMA_IRQ);
    bench.run_for(500 * MILLISECOND);
    assert_eq!(said_to(&mut bench, GCS), ["Crash: UART0 writer was overdue"]);
}

#[test]
fn a_task_that_was_overdue_and_came_back_is_not_blamed_for_what_happens_later() {
    let mut bench = between_ticks();
    bench.cut_interrupt(DMA_IRQ);
    let is_overdue = |board: &mut Board| {
        let lines = board.log_lines().iter();
        lines.rev().take(1).any(|line| line.text.contains("is overdue"))
    };
    assert!(bench.run_until(5 * SECOND, is_overdue));
    bench.restore_interrupt(DMA_IRQ);
    // Between two ticks again.
    bench.run_for(2_050 * MILLISECOND);
    assert!(bench.resets().is_empty(), "it is alive again");
    bench.hang_program();
    assert_reset(&mut bench, ResetCause::WatchdogTimer, TIMEOUT_US);
    assert_eq!(said_to(&mut bench, GCS), ["Crash: hung or locked up in no task"]);
}

#[test]
fn without_a_ground_station_the_record_survives_further_resets() {
    let mut bench = in_drive();
    bench.run_undefined_instruction();
    assert_reset(&mut bench, ResetCause::WatchdogForce, AT_ONCE_US);
    bench.reboot();
    bench.press_run();
    bench.run_for(500 * MILLISECOND);
    assert!(said_to(&mut bench, GCS)[0].starts_with("Crash: hard fault in drive"));
}

#[test]
fn the_latest_crash_is_reported() {
    let mut bench = in_drive();
    bench.run_undefined_instruction();
    assert_reset(&mut bench, ResetCause::WatchdogForce, AT_ONCE_US);
    // Until the log has it.
    bench.run_for(5 * SECOND);
    bench.hang_program();
    assert_reset(&mut bench, ResetCause::WatchdogTimer, TIMEOUT_US);
    assert_eq!(said_to(&mut bench, GCS), ["Crash: hung or locked up in no task"]);
    assert_logged(&bench, "Crash: hard fault in drive");
}

/// The tasks that the log of a start blames, after what was written by it.
fn crashes_in_the_log(bench: &mut Bench) -> Vec<String> {
    bench.run_for(5 * SECOND);
    let files = list(bench).into_iter();
    let records: Vec<_> = files.flat_map(|file| records(&download(bench, file))).collect();
    let crashes = named(&records, "CRSH");
    crashes
        .filter_map(|record| Some(record.get_str("Task")?.to_owned()))
        .collect()
}

#[test]
// Requirement: W-1
fn a_crash_is_in_the_log_of_the_first_start_after_it_without_arming() {
    let mut bench = in_drive();
    bench.run_undefined_instruction();
    assert_reset(&mut bench, ResetCause::WatchdogForce, AT_ONCE_US);
    assert_eq!(crashes_in_the_log(&mut bench), ["drive"]);
    bench.reboot();
    assert_eq!(crashes_in_the_log(&mut bench), ["drive"]);
    assert_eq!(list(&mut bench).len(), 1);
}

#[test]
fn intended_resets_are_not_reported_as_crashes() {
    let mut bench = between_ticks();
    bench.hang_program();
    assert_reset(&mut bench, ResetCause::WatchdogTimer, TIMEOUT_US);
    assert_eq!(said_to(&mut bench, GCS).len(), 1);
    arm_and_disarm(&mut bench);

    // A debugger resets the processor alone, and the watchdog still has the reason of the last reset.
    bench.reset_processor();
    bench.run_for(500 * MILLISECOND);
    assert_eq!(bench.logged(LogLevel::Info, "started by Processor").len(), 1);
    assert!(said_to(&mut bench, GCS).is_empty());

    // The boot ROM has flashed a UF2 file: the RUN pin has cleared the notes, and the watchdog is the boot ROM's.
    bench.write_register(RUNNING, 0);
    bench.cut_interrupt(0);
    bench.hang_program();
    assert_reset(&mut bench, ResetCause::WatchdogTimer, TIMEOUT_US);
    bench.restore_interrupt(0);
    bench.run_for(500 * MILLISECOND);
    assert_eq!(bench.logged(LogLevel::Info, "started by PowerOn").len(), 2);
    assert!(said_to(&mut bench, GCS).is_empty());
}

const POWER_WENT_OFF: &str = "Power went off while armed";
const RESET: &str = "Reset while armed";

/// The texts since `from_us` that report how a drive ended.
fn ends_since(bench: &mut Bench, from_us: u64) -> Vec<String> {
    let mut texts = texts_of(&bench.frames_since(from_us));
    texts.retain(|text| [POWER_WENT_OFF, RESET].contains(&text.as_str()));
    texts
}

/// The texts in the two seconds after a request that report how a drive ended.
fn ends_after(bench: &mut Bench, request: &[u8]) -> Vec<String> {
    let from_us = bench.time_us();
    bench.uart_send(0, from_us, request);
    bench.run_for(2 * SECOND);
    ends_since(bench, from_us)
}

#[test]
fn a_drive_that_power_or_a_reset_has_ended_is_reported_until_the_next_arming() {
    type End = fn(&mut Bench);
    for (name, end, text, at_arming) in [
        ("a dip", (|bench| bench.dip_power(0)) as End, POWER_WENT_OFF, true),
        (
            "a power cycle",
            |bench| bench.power_cycle(),
            POWER_WENT_OFF,
            false,
        ),
        ("RUN", |bench| bench.press_run(), RESET, false),
        ("a debugger", |bench| bench.reset_processor(), RESET, false),
    ] {
        let mut bench = between_ticks();
        bench.ask(&arm_by_force());
        bench.run_for(2 * SECOND);
        end(&mut bench);
        let from_us = bench.time_us();
        // A radio that the pack feeds does not listen yet.
        bench.run_for(5 * SECOND);
        assert_eq!(ends_since(&mut bench, from_us), [text], "{name}");
        assert_eq!(ends_after(&mut bench, &heartbeat(GCS)), [text], "{name}");
        assert_eq!(
            ends_after(&mut bench, &param_request_list(VEHICLE)),
            [text],
            "{name}"
        );
        let expected = if at_arming { vec![text] } else { vec![] };
        assert_eq!(ends_after(&mut bench, &arm_by_force()), expected, "{name}");
        bench.ask(&disarm());
        bench.dip_power(0);
        bench.run_for(2 * SECOND);
        assert!(ends_after(&mut bench, &heartbeat(GCS)).is_empty(), "{name}");
    }
}

#[test]
fn a_disarming_is_in_flash_before_the_power_goes() {
    let mut bench = between_ticks();
    // Whenever the log was written last.
    for drive_ms in (1000..1800).step_by(100) {
        bench.request(&arm_by_force());
        bench.run_for(drive_ms * MILLISECOND);
        bench.request(&disarm());
        bench.run_for(60 * MILLISECOND);
        bench.power_cycle();
        let from_us = bench.time_us();
        bench.run_for(2 * SECOND);
        assert!(ends_since(&mut bench, from_us).is_empty(), "after {drive_ms} ms");
    }
}

#[test]
fn the_next_log_begins_with_the_end_of_the_drive_before() {
    let mut bench = between_ticks();
    bench.ask(&arm_by_force());
    bench.run_for(2 * SECOND);
    bench.dip_power(0);
    bench.run_for(2 * SECOND);
    bench.ask(&arm_by_force());
    bench.run_for(3 * SECOND);
    bench.ask(&disarm());
    bench.run_for(5 * SECOND);
    let file = list(&mut bench).pop().expect("a log");
    let records = records(&download(&mut bench, file));
    let texts: Vec<_> = named(&records, "MSG")
        .filter_map(|record| record.get_str("Message"))
        .collect();
    assert_eq!(texts[1], POWER_WENT_OFF, "{texts:?}");
}
