//! The rover that obeys: arming, driving and stopping, at the pins of the motors.

use crate::wheels::{duties, pins};
use emulator::{AdcInput, Board, LogLevel, ResetCause};
use support::commands::ACCEPTED;
use support::frames::{BATTERY_STATUS, SYS_STATUS, last_of, of_message};
use support::motor_poles::{LEFT, motors};
pub use support::requests::VEHICLE_ID;
use support::requests::{arm, disarm, manual_control, manual_mode};
use workbench::bench::{Bench, CYCLES_PER_US, MILLISECOND, PACK, RUNNING, SECOND, TestedVehicle};
pub use workbench::driven_rover::steer_for;
use workbench::rover_circuit::{THREE_CELLS_V, connect};

/// The number of the exception.
const HARD_FAULT: u32 = 3;

const PWM_PERIOD_US: u64 = 2 * MILLISECOND;

/// The watchdog's quarter of a second while armed, and some time to spare.
const HANG_US: u64 = 350 * MILLISECOND;

/// The longest hang after a task that may be late by 150 ms.
const DRIVE_HANG_US: u64 = 450 * MILLISECOND;

/// Three LiPo cells at 3.8 V, and at 3.2 V.
pub const GOOD_3S: u16 = 3582;
pub const FLAT_3S: u16 = 3016;

pub fn is_coasting(bench: &Bench) -> bool {
    pins().all(|pin| bench.pin_level(pin) != Some(true)) && all_have(bench, (0.0, 0.0))
}

pub fn is_braking(bench: &Bench) -> bool {
    all_have(bench, (1.0, 1.0))
}

/// Whether all motors have these duties at their positive and negative poles.
fn all_have(bench: &Bench, expected: (f64, f64)) -> bool {
    motors().all(|motor| duties(motor, bench) == expected)
}

/// Lets time pass with a hand on the throttle.
pub fn drive_for(bench: &mut Bench, time_us: u64, throttle: i16) {
    steer_for(bench, time_us, 0, throttle);
}

/// The id of the task with this name: in the retained table of names it stands before it.
pub fn task_named(bench: &Bench, name: &[u8]) -> u32 {
    let retained = bench.section(".uninit");
    let bytes = bench.read_memory(retained.start, retained.len());
    let is_name = |place: &usize| bytes[*place..].starts_with(name);
    let place = (4..bytes.len()).step_by(4).find(is_name).expect("it has a name");
    u32::from_le_bytes(bytes[place - 4..place].try_into().expect("four bytes"))
}

/// A rover that drives at half power.
fn driving(parameters: &[(&str, f32)]) -> Bench {
    let mut all = vec![("BATT_CELLS", 3.0)];
    all.extend(parameters);
    let mut bench = Bench::configured(GOOD_3S, &all);
    connect(&mut bench, THREE_CELLS_V);
    assert_eq!(bench.result_of(&arm()), ACCEPTED);
    bench.ask(&manual_mode());
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    drive_for(&mut bench, 2 * SECOND, 500);
    for motor in motors() {
        let (positive, negative) = duties(motor, &bench);
        assert!((positive - 0.5).abs() < 0.01, "{motor:?}: {positive}");
        assert_eq!(negative, 0.0, "{motor:?}");
    }
    bench
}

/// The pin that is low while the rover drives ahead and high while it brakes.
const BRAKING_PIN: usize = LEFT[0].negative;

/// When that pin first stayed high, in microseconds.
fn braked_at_us(bench: &mut Bench) -> u64 {
    let changes = bench.take_pwm_changes(BRAKING_PIN);
    let braked = changes
        .iter()
        .find(|(_, output)| output.is_some_and(|output| output.duty == 1.0));
    braked.expect("it brakes").0 / CYCLES_PER_US
}

#[test]
fn the_motors_coast_from_reset_until_the_rover_is_armed() {
    let mut bench = Bench::power_up(GOOD_3S);
    pins().for_each(|pin| bench.record_pin(pin));
    bench.run_for(SECOND);
    drive_for(&mut bench, 2 * SECOND, 1000);
    for pin in pins() {
        assert!(bench.take_edges(pin).is_empty(), "GP{pin}");
        let changes = bench.take_pwm_changes(pin);
        assert!(
            changes
                .iter()
                .all(|(_, output)| output.is_none_or(|output| output.duty == 0.0)),
            "GP{pin}"
        );
    }
    assert!(is_coasting(&bench));
    // The throttle is released.
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    bench.ask(&arm());
    bench.run_for(100 * MILLISECOND);
    assert!(is_braking(&bench), "armed in HOLD it brakes");
    bench.ask(&disarm());
    assert!(is_coasting(&bench));
}

#[test]
// Requirement: OWN-3
fn a_critical_voltage_stops_it_within_the_timer_and_a_quarter_second() {
    let mut bench = driving(&[
        ("BATT_LOW_TIMER", 1.0),
        ("BATT_CRT_VOLT", 10.2),
        ("BATT_FS_CRT_ACT", 2.0),
    ]);
    bench.record_pin(BRAKING_PIN);
    // At any moment between two ticks.
    bench.run_for(37 * MILLISECOND);
    let fallen_us = bench.time_us();
    bench.adc_input(PACK, AdcInput::Code(FLAT_3S));
    drive_for(&mut bench, 2 * SECOND, 500);

    let decided_us = bench.logged(LogLevel::Info, "is critical")[0].0;
    let braked_us = braked_at_us(&mut bench);
    println!(
        "voltage falls; {} ms later it is critical; {} us later the motors brake",
        (decided_us - fallen_us) / 1000,
        braked_us - decided_us
    );
    assert!(braked_us - fallen_us <= 1250 * MILLISECOND);
    assert!(braked_us - decided_us <= 50 * MILLISECOND);
}

#[test]
fn a_fault_lets_the_motors_coast_before_it_restarts_the_board() {
    let mut bench = driving(&[]);
    let resets = bench.resets().len();
    bench.run_undefined_instruction();
    let coasts_in_the_handler = |board: &mut Board| {
        let is_held_low = |pin| board.pwm_output(pin).is_none() && board.pin_level(pin) == Some(false);
        board.active_exception() == HARD_FAULT && pins().all(is_held_low)
    };
    assert!(bench.run_until(PWM_PERIOD_US, coasts_in_the_handler));
    assert_eq!(bench.resets().len(), resets, "it is the handler that stops them");
    assert!(bench.run_until(MILLISECOND, |board| board.resets().len() > resets));
    assert!(is_coasting(&bench));
    bench.run_for(2 * SECOND);
    assert!(is_coasting(&bench), "not armed after a reset");
}

#[test]
fn a_hang_right_after_arming_lets_the_motors_coast_after_the_watchdogs_time() {
    let mut bench = Bench::configured(GOOD_3S, &[("BATT_CELLS", 3.0)]);
    connect(&mut bench, THREE_CELLS_V);
    bench.run_for(SECOND);
    assert_eq!(bench.result_of(&arm()), 0);
    assert!(is_braking(&bench));
    let reset = bench.reset_by(HANG_US, |bench| bench.hang_program());
    assert_eq!(reset.cause, ResetCause::WatchdogTimer);
    bench.run_for(MILLISECOND);
    assert!(is_coasting(&bench));
}

#[test]
// Requirement: R-13
fn a_drive_task_that_does_not_run_any_more_lets_the_motors_coast() {
    /// States of a task (embassy-executor): it waits to be woken; it waits for its turn, so that nothing wakes it.
    const SPAWNED: [u8; 4] = [1, 0, 0, 0];
    const SPAWNED_AND_QUEUED: [u8; 4] = [3, 0, 0, 0];
    const HEADER_BYTES: usize = 32;
    let mut bench = driving(&[]);
    // Its turns come every 20 ms: it waits 5 ms behind one.
    let drive = task_named(&bench, b"drive");
    let runs = |board: &mut Board| board.read_register(RUNNING) == drive;
    assert!(bench.run_until(50 * MILLISECOND, runs));
    bench.run_for(5 * MILLISECOND);
    let header = bench.read_memory(drive, HEADER_BYTES);
    let state = header
        .chunks(4)
        .position(|word| word == SPAWNED)
        .expect("it waits");
    let hung_us = bench.time_us();
    bench.reset_by(2 * SECOND, |bench| {
        bench.write_memory(drive + 4 * state as u32, &SPAWNED_AND_QUEUED);
    });
    let after_us = bench.time_us() - hung_us;
    println!("{after_us} us");
    assert!(after_us <= DRIVE_HANG_US, "{after_us}");
    bench.run_for(500 * MILLISECOND);
    let named = bench.logged(LogLevel::Warn, "task drive is overdue");
    assert!(!named.is_empty(), "{:?}", bench.log_lines());
}

#[test]
// Requirement: FR-8
fn the_smallest_firmware_drives_by_gamepad_and_stops_without_it_at_its_telemetry_rate() {
    let mut bench = Bench::power_up_example("mavlink_rc_control");
    bench.adc_input(PACK, AdcInput::Code(GOOD_3S));
    bench.run_for(SECOND);
    assert!(is_coasting(&bench));
    bench.set("MOT_DRV_VOLT", 0.0);
    // The throttle is released.
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    bench.ask(&arm());
    bench.ask(&manual_mode());
    bench.forget_sent();
    drive_for(&mut bench, 10 * SECOND, -1000);
    assert!(all_have(&bench, (0.0, 1.0)), "full speed back");
    let frames = bench.frames();
    for message in [SYS_STATUS, BATTERY_STATUS] {
        let count = of_message(&frames, message).len();
        assert!(count.abs_diff(20) <= 1, "{message}: {count}");
    }
    let off_mv = i32::from(last_of(&frames, 0).voltage_mv(0)) - 11_400;
    assert!(off_mv.abs() < 20, "off by {off_mv} mV");
    bench.run_for(1_700 * MILLISECOND);
    assert!(is_braking(&bench), "it brakes");
    assert!(bench.resets().is_empty());
}
