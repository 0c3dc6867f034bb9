//! Parameters of the sticks' channels, as a ground station, a file or a reset sets them: which channels drive, and when arming
//! is refused.

use rover_battmon::parameter::{StickParameter, VehicleParameter};
use rover_battmon::vehicle::{ArmState, MotorDrive, SideDrives};
use support::commands::{PREFLIGHT_STORAGE, RESET};
use support::desk::{Desk, id_of, start_with};
use support::frames::{PARAM_ERROR, RC_CHANNELS_OVERRIDE, encode_v2, of_message, texts_of};
use support::requests::{
    VEHICLE, arm, arm_by_force, command_long, disarm, do_set_mode, manual_control, param_set, rc_override,
};

const NEUTRAL_US: u16 = 1500;

/// A rover without packs and without a slew rate limit.
fn started() -> Desk {
    let mut desk = Desk::starting(start_with(&[("BATT_MONITOR", 0.0), ("MOT_SLEWRATE", 0.0)]));
    wait(&mut desk);
    desk
}

fn wait(desk: &mut Desk) {
    desk.now_us += 20_000;
    desk.drive();
}

/// Sets parameters one after the other, as a ground station does with a file, and asserts that each is taken.
fn load(desk: &mut Desk, values: &[(&str, f32)]) {
    for (name, value) in values {
        let answers = desk.ask(&param_set(name, *value));
        assert!(of_message(&answers, PARAM_ERROR).is_empty(), "{name} {value}");
        assert_eq!(desk.parameters().get(id_of(name)), *value, "{name}");
        wait(desk);
    }
}

/// Every order of four values.
fn orders<T: Copy>(of: [T; 4]) -> Vec<[T; 4]> {
    let mut orders = Vec::new();
    for first in 0..4 {
        for second in (0..4).filter(|second| *second != first) {
            for third in (0..4).filter(|third| ![first, second].contains(third)) {
                orders.push([first, second, third, 6 - first - second - third].map(|at: usize| of[at]));
            }
        }
    }
    orders
}

fn texts(desk: &mut Desk, request: &[u8]) -> Vec<String> {
    let answers = desk.ask(request);
    texts_of(&answers)
}

/// Pushes a channel, with the others neutral.
fn push(desk: &mut Desk, channel: usize, pulse_us: u16) {
    let mut pulses_us = [NEUTRAL_US; 8];
    pulses_us[channel - 1] = pulse_us;
    let payload = [&pulses_us.map(u16::to_le_bytes).concat()[..], &[1, 1]].concat();
    desk.receive_in_chunks(&encode_v2(RC_CHANNELS_OVERRIDE, &payload), 64);
    wait(desk);
}

/// Arms by force, drives each channel to its end in turns, and returns what the motors do then.
fn driven(desk: &mut Desk) -> Vec<(usize, SideDrives)> {
    push(desk, 8, NEUTRAL_US);
    desk.ask(&arm_by_force());
    desk.ask(&do_set_mode(0.0));
    assert_eq!(desk.vehicle().arm_state(), ArmState::Armed);
    let mut driven = Vec::new();
    for channel in 1..=8 {
        push(desk, channel, NEUTRAL_US);
        push(desk, channel, 2000);
        // A side that reverses takes a quarter of a second.
        (0..13).for_each(|_| wait(desk));
        let drives = desk.vehicle().drives();
        if drives != SideDrives::COAST {
            driven.push((channel, drives));
        }
    }
    push(desk, 8, NEUTRAL_US);
    desk.ask(&disarm());
    driven
}

/// Steering to the right by a channel, and full throttle by another, in the order of the channels.
fn by(steering: usize, throttle: usize) -> Vec<(usize, SideDrives)> {
    let [left, right] = [1.0, -1.0].map(MotorDrive::Turn);
    let ahead = SideDrives { left, right: left };
    let mut driven = vec![(steering, SideDrives { left, right }), (throttle, ahead)];
    driven.sort_by_key(|(channel, _)| *channel);
    driven
}

#[test]
fn a_reset_of_parameters_puts_the_sticks_back_at_once() {
    let mut desk = started();
    load(&mut desk, &[("RCMAP_PITCH", 5.0), ("RCMAP_THROTTLE", 2.0)]);
    assert_eq!(driven(&mut desk), by(1, 2));
    desk.ask(&command_long(PREFLIGHT_STORAGE, RESET));
    desk.set(VehicleParameter::MotSlewrate, 0.0);
    wait(&mut desk);
    assert_eq!(desk.parameters().get(StickParameter::RcmapThrottle), 3.0);
    assert_eq!(driven(&mut desk), by(1, 3));
}

#[test]
fn a_file_with_moved_pulses_loads_in_any_order() {
    let file = [
        ("RC3_MIN", 1700.0),
        ("RC3_TRIM", 1850.0),
        ("RC3_MAX", 2000.0),
        ("RC3_REVERSED", 1.0),
    ];
    for order in orders(file) {
        let mut desk = started();
        load(&mut desk, &order);
        assert_eq!(texts(&mut desk, &arm()), [""; 0], "{order:?}");
        push(&mut desk, 3, 1850);
        desk.ask(&do_set_mode(0.0));
        push(&mut desk, 3, 1850);
        push(&mut desk, 3, 2000);
        let back = MotorDrive::Turn(-1.0);
        let both = SideDrives {
            left: back,
            right: back,
        };
        assert_eq!(desk.vehicle().drives(), both, "{order:?}");
    }
}

#[test]
fn what_does_not_fit_refuses_arming_by_name_and_the_last_that_did_drives() {
    for (values, text, driving) in [
        (
            &[("RCMAP_PITCH", 5.0), ("RCMAP_THROTTLE", 2.0), ("RCMAP_ROLL", 2.0)][..],
            "Arm: RCMAP_THROTTLE does not fit RCMAP_ROLL",
            by(1, 2),
        ),
        (
            &[("RCMAP_THROTTLE", 4.0)],
            "Arm: RCMAP_THROTTLE does not fit RCMAP_YAW",
            by(1, 3),
        ),
        (
            &[("RCMAP_PITCH", 1.0)],
            "Arm: RCMAP_ROLL does not fit RCMAP_PITCH",
            by(1, 3),
        ),
        (
            &[("RC1_MIN", 1401.0)],
            "Arm: RC1_MIN does not fit RC1_TRIM",
            by(1, 3),
        ),
        (
            &[("RC3_TRIM", 1901.0)],
            "Arm: RC3_TRIM does not fit RC3_MAX",
            by(1, 3),
        ),
        (
            &[("RC3_MAX", 1599.0), ("RC3_REVERSED", 1.0)],
            "Arm: RC3_TRIM does not fit RC3_MAX",
            by(1, 3),
        ),
    ] {
        let mut desk = started();
        load(&mut desk, values);
        assert_eq!(texts(&mut desk, &arm()), [text], "{values:?}");
        assert_eq!(driven(&mut desk), driving, "{values:?}");
        // Without the checks of the sticks.
        load(&mut desk, &[("ARMING_CHECK", 256.0)]);
        assert_eq!(texts(&mut desk, &arm()), [""; 0], "{values:?}");
        desk.ask(&disarm());
        load(&mut desk, &[("ARMING_CHECK", 64.0)]);
        assert_eq!(texts(&mut desk, &arm()), [text], "{values:?}");
    }
}

#[test]
// Requirement: OWN-2
fn values_that_no_stick_has_refresh_none() {
    let pulses_us = |pulse_us: u16| rc_override(VEHICLE, NEUTRAL_US, pulse_us);
    let axis = |position: i16| manual_control(VEHICLE[0], 0, position);
    let turn = |share| Some(MotorDrive::Turn(share));
    for (centred, deflected, stick, expected) in [
        (pulses_us(1500), pulses_us(1800), pulses_us(799), None),
        (pulses_us(1500), pulses_us(1800), pulses_us(800), turn(-1.0)),
        (pulses_us(1500), pulses_us(1800), pulses_us(2200), turn(1.0)),
        (pulses_us(1500), pulses_us(1800), pulses_us(2201), None),
        (pulses_us(1500), pulses_us(1800), pulses_us(1), None),
        (pulses_us(1500), pulses_us(1800), pulses_us(65534), None),
        (pulses_us(1500), pulses_us(1800), pulses_us(65535), None),
        (
            pulses_us(1500),
            pulses_us(1800),
            pulses_us(0),
            Some(MotorDrive::Coast),
        ),
        (axis(0), axis(600), axis(-1001), None),
        (axis(0), axis(600), axis(-1000), turn(-1.0)),
        (axis(0), axis(600), axis(1000), turn(1.0)),
        (axis(0), axis(600), axis(1001), None),
        (axis(0), axis(600), axis(i16::MIN), None),
        (axis(0), axis(600), axis(i16::MAX - 1), None),
        (axis(0), axis(600), axis(i16::MAX), Some(MotorDrive::Coast)),
    ] {
        let mut desk = started();
        desk.ask(&arm_by_force());
        desk.ask(&do_set_mode(0.0));
        let mut hold = |stick: &[u8], ticks| {
            for _ in 0..ticks {
                desk.receive_in_chunks(stick, 64);
                wait(&mut desk);
            }
            desk.vehicle().drives().left
        };
        hold(&centred, 1);
        assert_eq!(hold(&deflected, 5), MotorDrive::Turn(0.6), "{stick:?}");
        // Shortly before the time-out, and after it.
        let drives = [hold(&stick, 70), hold(&stick, 30)];
        let expected = expected.map_or([MotorDrive::Turn(0.6), MotorDrive::Brake], |drive| [drive; 2]);
        assert_eq!(drives, expected, "{stick:?}");
    }
    // Nor do they stand in the way of arming, or of another driver.
    let mut desk = started();
    for stick in [pulses_us(2201), axis(1001)] {
        desk.receive_in_chunks(&stick, 64);
        assert_eq!(texts(&mut desk, &arm()), [""; 0]);
        desk.ask(&disarm());
    }
}
