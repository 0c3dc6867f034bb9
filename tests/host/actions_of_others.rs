//! Actions of one station that concern all the others: each is announced on each link, and commands are in the log.

use std::io::Cursor;

use ardupilot_binlog::{Entry, Reader};
use rover_battmon::mavlink::{Endpoint, LinkKind};
use support::commands::{
    ACCEPTED, ARM_DISARM, BATTERY_RESET, FAILED, RUN_PREARM_CHECKS, SET_MESSAGE_INTERVAL,
};
use support::desk::{Desk, frames_of, start_with};
use support::frames::texts_of;
use support::requests::{
    arm_by_force, command_int_2, command_long, command_long_2, disarm, log_erase, param_set,
};
use support::time::SECOND;

use crate::logged_rover::{Flash, Rover};

const DO_SET_MODE: u16 = 176;

/// A rover with a pack and a log.
fn rover() -> Rover {
    let start = start_with(&[("BATT_MONITOR", 4.0)]);
    Rover::with(Desk::starting(start), Flash::blank())
}

/// The texts that a second link gets after a request at the first one.
fn texts_of_another(rover: &mut Rover, request: &[u8]) -> Vec<String> {
    let desk = &mut rover.desk;
    let now = desk.now();
    let mut another = Endpoint::new("another", LinkKind::Wifi, 100_000, now);
    desk.autopilot.open(&mut another);
    frames_of(&mut desk.autopilot, &mut another, &mut desk.framer, now, 100);
    desk.ask(request);
    desk.autopilot.post_due(&mut another, now);
    let frames = frames_of(&mut desk.autopilot, &mut another, &mut desk.framer, now, 100);
    texts_of(&frames)
}

#[test]
fn each_link_learns_of_what_a_station_has_reset_or_erased() {
    for (request, expected) in [
        (
            command_long_2(BATTERY_RESET, 1.0, 80.4),
            "desk: reset to 80%, battery 1",
        ),
        (
            command_long_2(BATTERY_RESET, -1.0, 100.0),
            "desk: reset to 100%, battery 1",
        ),
        (log_erase(), "desk: logs erased"),
        (
            param_set("BATT_LRN_ERASE", 1.0),
            "desk: learnt data of battery 1 erased",
        ),
    ] {
        let mut rover = rover();
        let texts = texts_of_another(&mut rover, &request);
        assert!(texts.iter().any(|text| text == expected), "{expected}: {texts:?}");
    }
    // One that resets nothing.
    let texts = texts_of_another(&mut rover(), &command_long_2(BATTERY_RESET, 256.0, 100.0));
    assert!(texts.iter().all(|text| !text.contains("reset")), "{texts:?}");
}

/// The commands in the log: number, first parameter, result, whether it was a COMMAND_LONG.
fn commands(rover: &mut Rover) -> Vec<(u64, f64, u64, u64)> {
    let reader = Reader::new(Cursor::new(rover.file(1)));
    let records = reader.map(|record| record.expect("no error"));
    let number = |record: &Entry, name: &str| record.get_i64(name).expect("a number") as u64;
    let commands = records.filter(|record| record.name == "MAVC");
    commands
        .map(|record| {
            let sender = [number(&record, "SS"), number(&record, "SC")];
            assert_eq!(sender, [255, 190]);
            (
                number(&record, "Cmd"),
                record.get_f64("P1").expect("a number"),
                number(&record, "Res"),
                number(&record, "WL"),
            )
        })
        .collect()
}

#[test]
fn commands_that_change_something_are_in_the_log_at_once_with_their_results() {
    let mut rover = rover();
    rover.desk.ask(&arm_by_force());
    rover.turn();
    for request in [
        command_int_2(DO_SET_MODE, 1.0, 4.0),
        command_long(RUN_PREARM_CHECKS, 0.0),
        command_long_2(SET_MESSAGE_INTERVAL, 147.0, 1e6),
        command_long_2(BATTERY_RESET, 0.0, 50.0),
        disarm(),
    ] {
        rover.desk.ask(&request);
    }
    rover.turn();
    let (accepted, failed) = (u64::from(ACCEPTED), u64::from(FAILED));
    let expected = [
        (u64::from(DO_SET_MODE), 1.0, accepted, 0),
        (u64::from(BATTERY_RESET), 0.0, failed, 1),
        (u64::from(ARM_DISARM), 0.0, accepted, 1),
    ];
    assert_eq!(commands(&mut rover), expected);
}

#[test]
fn five_commands_a_second_are_in_the_log_at_most() {
    let mut rover = rover();
    rover.desk.ask(&arm_by_force());
    rover.turn();
    for _ in 0..100 {
        rover.desk.ask(&command_long_2(BATTERY_RESET, 1.0, 50.0));
        rover.turn();
    }
    let recorded = commands(&mut rover).len();
    assert!((5..=10).contains(&recorded), "{recorded} in two seconds");
    rover.run(10);
    for _ in 0..5 {
        rover.desk.ask(&command_long_2(BATTERY_RESET, 1.0, 50.0));
    }
    rover.turn();
    assert_eq!(commands(&mut rover).len(), recorded + 5);
}

#[test]
fn the_system_id_is_not_changed_while_armed() {
    let mut desk = Desk::without_packs();
    desk.ask(&arm_by_force());
    desk.now_us += SECOND;
    desk.ask(&param_set("SYSID_THISMAV", 7.0));
    desk.post_due(desk.now_us);
    let texts = texts_of(&desk.sent());
    assert_eq!(texts, ["SYSID_THISMAV refused: not changed while armed"]);
    assert_eq!(desk.parameters().system_id(), 1);
    // An equal value changes nothing.
    desk.ask(&param_set("SYSID_THISMAV", 1.0));
    desk.post_due(desk.now_us);
    assert!(texts_of(&desk.sent()).is_empty());
    desk.ask(&disarm());
    desk.ask(&param_set("SYSID_THISMAV", 7.0));
    assert_eq!(desk.parameters().system_id(), 7);
}
