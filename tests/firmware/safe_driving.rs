//! No stale order drives: the effect of stick input, commands and timeouts at the pins of the motors.

use crate::rover::{CUSTOM_MODE_ENABLED, GOOD_3S, MANUAL, VEHICLE_ID, drive_for, is_braking, is_coasting};
use crate::wheels::duties;
use support::frames::{COMMAND_ACK, Frame, STATUSTEXT, of_message};
use support::motor_poles::motors;
use support::requests::{
    EVERYONE, VEHICLE, arm, command_long, command_long_2, disarm, heartbeat, manual_control,
    param_read_by_name, provoke_fault, rc_override, reboot, reboot_to_boot_loader, set_mode,
};
use workbench::bench::{Bench, MILLISECOND, SECOND, value_of};

const ACCEPTED: u8 = 0;
const FAILED: u8 = 4;

const ARM_DISARM: u16 = 400;
const FORCED: f32 = 21196.0;
const RESET_PARAMETERS: u16 = 245;
const GROUND_STATION: u8 = 6;

/// RC_CHANNELS_OVERRIDE: the channel stays as it is, or has its middle or its end.
const UNCHANGED_US: u16 = u16::MAX;
const MIDDLE_US: u16 = 1500;
const FULL_US: u16 = 2000;

/// A rover that follows stick input at once.
fn rover() -> Bench {
    Bench::configured(GOOD_3S, &[("BATT_CELLS", 3.0), ("MOT_SLEWRATE", 0.0)])
}

fn armed_in_manual() -> Bench {
    let mut bench = rover();
    assert_eq!(result(&bench.ask(&arm())), ACCEPTED);
    to_manual(&mut bench);
    bench
}

fn to_manual(bench: &mut Bench) {
    bench.ask(&set_mode(VEHICLE_ID, CUSTOM_MODE_ENABLED, MANUAL));
}

fn result(answers: &[Frame]) -> u8 {
    of_message(answers, COMMAND_ACK)[0].u8(2)
}

fn texts(frames: &[Frame]) -> Vec<String> {
    of_message(frames, STATUSTEXT)
        .iter()
        .map(|frame| frame.text(1, 50))
        .collect()
}

/// Sends a message ten times a second, and panics if a motor turns in between.
fn send_and_stand(bench: &mut Bench, message: &[u8], time_us: u64) {
    for _ in 0..time_us / (100 * MILLISECOND) {
        bench.ask(message);
        assert!(!is_turning(bench));
    }
}

/// A motor with another duty at its one pole than at the other.
fn is_turning(bench: &Bench) -> bool {
    motors().any(|motor| {
        let (positive, negative) = duties(motor, bench);
        positive != negative
    })
}

#[test]
fn a_steering_override_does_not_bring_an_old_throttle_back() {
    let mut bench = armed_in_manual();
    bench.ask(&rc_override(VEHICLE, MIDDLE_US, FULL_US));
    assert!(is_turning(&bench));
    bench.run_for(2 * SECOND);
    assert!(is_braking(&bench), "Radio Failsafe");
    bench.ask(&rc_override(VEHICLE, MIDDLE_US, UNCHANGED_US));
    to_manual(&mut bench);
    send_and_stand(&mut bench, &rc_override(VEHICLE, MIDDLE_US, UNCHANGED_US), SECOND);
}

#[test]
fn a_throttle_that_is_not_repeated_stops_while_steering_goes_on() {
    let mut bench = armed_in_manual();
    bench.ask(&rc_override(VEHICLE, MIDDLE_US, FULL_US));
    for _ in 0..8 {
        bench.ask(&rc_override(VEHICLE, 1600, UNCHANGED_US));
    }
    assert!(is_braking(&bench));
    assert!(texts(&bench.frames()).contains(&"Radio Failsafe: Hold".to_owned()));
}

#[test]
fn stick_input_from_before_arming_does_not_drive_after_a_timeout() {
    let mut bench = rover();
    to_manual(&mut bench);
    bench.ask(&manual_control(VEHICLE_ID, 0, 1000));
    bench.run_for(2 * SECOND);
    assert_eq!(result(&bench.ask(&arm())), ACCEPTED);
    send_and_stand(&mut bench, &rc_override(VEHICLE, MIDDLE_US, UNCHANGED_US), SECOND);
}

#[test]
fn it_is_not_armed_while_the_throttle_is_pushed() {
    let mut bench = rover();
    to_manual(&mut bench);
    drive_for(&mut bench, SECOND, 1000);
    let answers = bench.ask(&arm());
    assert_eq!(result(&answers), FAILED);
    assert_eq!(texts(&answers), ["Arm: Throttle (RC3) is not neutral"]);
    assert!(is_coasting(&bench));
    // Forced arming is accepted, and the stick has to be neutral once.
    drive_for(&mut bench, 200 * MILLISECOND, 1000);
    assert_eq!(
        result(&bench.ask(&command_long_2(ARM_DISARM, 1.0, FORCED))),
        ACCEPTED
    );
    send_and_stand(&mut bench, &manual_control(VEHICLE_ID, 0, 1000), 2 * SECOND);
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    bench.ask(&manual_control(VEHICLE_ID, 0, 1000));
    assert!(is_turning(&bench));
}

#[test]
fn a_driving_rover_is_neither_restarted_nor_reset_to_defaults() {
    let mut bench = armed_in_manual();
    let resets = bench.resets().len();
    for request in [
        reboot(),
        reboot_to_boot_loader(),
        provoke_fault(),
        command_long(RESET_PARAMETERS, 2.0),
    ] {
        bench.ask(&manual_control(VEHICLE_ID, 0, 1000));
        let answers = bench.ask(&request);
        assert_eq!(
            (result(&answers), texts(&answers)),
            (FAILED, vec!["Not while armed: disarm first".to_owned()])
        );
        assert!(is_turning(&bench));
    }
    bench.ask(&disarm());
    bench.run_for(4 * SECOND);
    assert_eq!(bench.resets().len(), resets);
    assert_eq!(
        value_of(&bench.ask(&param_read_by_name("BATT_CELLS")), "BATT_CELLS"),
        Some(3.0)
    );
}

#[test]
fn a_rover_that_is_about_to_restart_is_not_armed() {
    let mut bench = rover();
    let request = [reboot(), command_long_2(ARM_DISARM, 1.0, FORCED)].concat();
    let answers = bench.ask(&request);
    assert_eq!(texts(&answers), ["Arm: restarting"]);
    let results: Vec<_> = of_message(&answers, COMMAND_ACK)
        .iter()
        .map(|ack| ack.u8(2))
        .collect();
    assert_eq!(results, [ACCEPTED, FAILED]);
    assert!(is_coasting(&bench));
}

#[test]
fn overrides_of_other_channels_stand_neither_for_a_driver_nor_for_a_ground_station() {
    let mut bench = armed_in_manual();
    bench.ask(&heartbeat(GROUND_STATION));
    for _ in 0..60 {
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &rc_override(VEHICLE, UNCHANGED_US, UNCHANGED_US));
        bench.run_for(100 * MILLISECOND);
    }
    assert!(is_braking(&bench));
    assert!(texts(&bench.frames()).contains(&"GCS Failsafe: Hold".to_owned()));
}

#[test]
fn an_override_to_everyone_or_another_vehicle_drives_nothing() {
    let mut bench = armed_in_manual();
    for target in [EVERYONE, [0, 1], [2, 1], [1, 154]] {
        send_and_stand(
            &mut bench,
            &rc_override(target, MIDDLE_US, FULL_US),
            300 * MILLISECOND,
        );
    }
    bench.ask(&rc_override(VEHICLE, MIDDLE_US, FULL_US));
    assert!(is_turning(&bench));
}
