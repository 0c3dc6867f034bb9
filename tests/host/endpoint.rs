//! Our end of a link: frames in, frames out.

use std::collections::HashMap;

use proptest::prelude::*;
use rover_battmon::announce::Severity;
use rover_battmon::battery::{BatteryState, PackDetails, PackStatus};
use rover_battmon::mavlink::{Action, Event, LinkKind};
use rover_battmon::pack::{MAX_PACKS, Pack, PackSet};
use rover_battmon::parameter::{BatteryParameter, ParameterId, Unsaved};
use rover_battmon::sensor::ChargerPower;
use support::commands::{
    ACCEPTED, BATTERY_RESET, DENIED, FAILED, GET_MESSAGE_INTERVAL, PREFLIGHT_REBOOT_SHUTDOWN,
    PREFLIGHT_STORAGE, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, UNSUPPORTED,
};
use support::desk::{Desk, EXTRA1, start_with};
use support::frames::{
    AUTOPILOT_VERSION, AVAILABLE_MODES, BATTERY_INFO, BATTERY_STATUS, BATTERY_STATUS_V2, BatteryStatus,
    COMMAND_ACK, COMMAND_LONG, FUEL_STATUS, Frame, GROUND_STATION, HEARTBEAT, MESSAGE_INTERVAL,
    NAMED_VALUE_FLOAT, PARAM_ERROR, PARAM_REQUEST_LIST, PARAM_VALUE, PING, PROTOCOL_VERSION, ParamValue,
    SMART_BATTERY_INFO, STATUSTEXT, SYS_STATUS, SysStatus, TIMESYNC, encode_v1, encode_v2,
    encode_v2_with_flags, of_message,
};
use support::requests::{
    EVERYONE, GCS, ONBOARD_CONTROLLER, SIK_RADIO, VEHICLE, command_int, command_int_2, command_long,
    command_long_2, heartbeat_from, param_read_by_index, param_read_by_name, param_request_list, param_set,
    param_set_payload, param_set_to, ping, radio_status_from, request_data_stream, timesync,
};

use crate::builders::{self, on_board_only, tank};

const VOLT_MULT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::VoltMult);

const DOES_NOT_EXIST: u8 = 1;
const VALUE_OUT_OF_RANGE: u8 = 2;
const READ_ONLY: u8 = 5;

#[track_caller]
fn assert_ack(frame: &Frame, command: u16, result: u8) {
    assert_eq!(frame.message_id, COMMAND_ACK);
    assert_eq!((frame.u16(0), frame.u8(2)), (command, result));
    // Addressed to the ground station that asked.
    assert_eq!((frame.u8(8), frame.u8(9)), (255, 190));
}

/// Delivers a command, and returns what follows its acknowledgement.
#[track_caller]
fn command(desk: &mut Desk, number: u16, parameters: [f32; 2], result: u8) -> Vec<Frame> {
    let mut answers = desk.ask(&command_long_2(number, parameters[0], parameters[1]));
    assert_ack(&answers.remove(0), number, result);
    answers
}

/// Requests a message that there is of this instance, and returns it.
#[track_caller]
fn requested(desk: &mut Desk, message: u32, instance: f32) -> Frame {
    let answers = command(desk, REQUEST_MESSAGE, [message as f32, instance], ACCEPTED);
    assert_eq!((answers.len(), answers[0].message_id), (1, message));
    answers[0].clone()
}

#[track_caller]
fn assert_denied(desk: &mut Desk, message: u32, instances: &[f32]) {
    for instance in instances {
        assert_eq!(
            command(desk, REQUEST_MESSAGE, [message as f32, *instance], DENIED),
            []
        );
    }
}

#[track_caller]
fn set_interval(desk: &mut Desk, message: u32, interval_us: f32) {
    let parameters = [message as f32, interval_us];
    assert_eq!(command(desk, SET_MESSAGE_INTERVAL, parameters, ACCEPTED), []);
}

#[test]
// Requirement: AP-26
fn every_parameter_is_read_by_name_and_what_is_listed_by_index() {
    let mut desk = Desk::without_packs();
    for id in ParameterId::all() {
        let answer = desk.one_answer(&param_read_by_name(&id.name()));
        desk.assert_param_value(&answer, id, id.default_value());
    }
    let listed: Vec<_> = desk.parameters().listed().collect();
    for (index, id) in (0..).zip(listed) {
        let answer = desk.one_answer(&param_read_by_index(index));
        assert_eq!(ParamValue(&answer).index(), index as u16);
        desk.assert_param_value(&answer, id, id.default_value());
    }
    let answer = desk.one_answer(&param_read_by_name("batt_volt_mult"));
    desk.assert_param_value(&answer, VOLT_MULT, 3.95);
}

#[test]
// Requirement: AP-26
fn what_does_not_exist_is_an_error_that_says_so() {
    let mut desk = Desk::without_packs();
    let behind_the_last = desk.parameters().listed_count() as i16;
    for request in [
        param_read_by_name("NOPE"),
        param_read_by_name(""),
        param_read_by_index(behind_the_last),
        param_read_by_index(-2),
        param_set("NOPE", 1.0),
    ] {
        let answer = desk.one_answer(&request);
        assert_eq!(answer.message_id, PARAM_ERROR);
        assert_eq!((answer.u8(2), answer.u8(3)), (255, 190));
        assert_eq!(answer.u8(20), DOES_NOT_EXIST);
    }
}

#[test]
// Requirement: AP-29
fn a_name_of_ardupilot_4_7_sets_and_reads_its_parameter_and_is_in_no_list() {
    let mut desk = Desk::without_packs();
    let shown = |frame: &Frame| {
        let answer = ParamValue(frame);
        assert_eq!(answer.index(), u16::MAX);
        (answer.name(), answer.value())
    };
    for (newer, own, value, own_value) in [
        ("MAV1_EXTRA1", "SR0_EXTRA1", 7.0, 7.0),
        ("MAV1_PARAMS", "SR0_PARAMS", 20.0, 20.0),
        ("ARMING_SKIPCHK", "ARMING_CHECK", 256.0, 1088.0),
        ("ARMING_SKIPCHK", "ARMING_CHECK", 1344.0, 0.0),
        ("ARMING_SKIPCHK", "ARMING_CHECK", -1.0, 0.0),
    ] {
        let set = desk.one_answer(&param_set(newer, value));
        assert_eq!(shown(&set), (newer.into(), value));
        let id = ParameterId::from_name(own.as_bytes()).unwrap();
        assert_eq!(desk.parameters().get(id), own_value, "{newer}");
    }
    let read = desk.one_answer(&param_read_by_name("arming_skipchk"));
    assert_eq!(shown(&read), ("ARMING_SKIPCHK".into(), -1.0));
    let [error, kept] = &desk.ask(&param_set("MAV1_EXTRA1", 99.0))[..] else {
        panic!("an error and the value");
    };
    assert_eq!(error.message_id, PARAM_ERROR);
    assert_eq!(shown(kept), ("MAV1_EXTRA1".into(), 7.0));
    let own = desk.one_answer(&param_read_by_name("SR0_EXTRA1"));
    assert_eq!(ParamValue(&own).value(), 7.0);
    let listed = desk.list(|_, _| {});
    assert!(
        listed
            .iter()
            .all(|name| !name.starts_with("MAV") && name != "ARMING_SKIPCHK")
    );
    // The last one: the board has another address then.
    let set = desk.one_answer(&param_set("MAV_SYSID", 9.0));
    assert_eq!(shown(&set), ("MAV_SYSID".into(), 9.0));
    desk.post_due(desk.next_due_us());
    let streams = desk.sent();
    assert!(!streams.is_empty() && streams.iter().all(|frame| frame.system_id == 9));
}

#[test]
fn a_set_value_is_live_and_acknowledged_at_once() {
    let mut desk = Desk::without_packs();
    desk.assert_set("SR0_EXTRA1", EXTRA1, 10.0);
    assert_eq!(desk.parameters().get(EXTRA1), 10.0);
    let answer = desk.one_answer(&param_set_to(EVERYONE, "SR0_EXTRA1", 5.0));
    desk.assert_param_value(&answer, EXTRA1, 5.0);
    assert_eq!(
        desk.parameters().next_unsaved(),
        Some(Unsaved::Value(EXTRA1, 5.0))
    );
}

/// Asserts that a value is refused by an error, and the old one shown.
#[track_caller]
fn assert_refused(desk: &mut Desk, id: ParameterId, value: f32, error: u8) {
    let old = desk.parameters().get(id);
    let answers = desk.ask(&param_set(&id.name(), value));
    assert_eq!(answers.len(), 2, "{answers:?}");
    assert_eq!((answers[0].message_id, answers[0].u8(20)), (PARAM_ERROR, error));
    assert_eq!(answers[0].text(4, 16), id.name().as_str());
    desk.assert_param_value(&answers[1], id, old);
}

#[test]
fn a_value_out_of_range_is_refused_and_the_old_one_shown() {
    let mut desk = Desk::without_packs();
    for value in [-1.0, 51.0, f32::NAN, f32::INFINITY] {
        assert_refused(&mut desk, EXTRA1, value, VALUE_OUT_OF_RANGE);
    }
    assert_eq!(desk.parameters().get(EXTRA1), 2.0);
    assert_eq!(desk.parameters().next_unsaved(), None);
}

#[test]
fn what_ground_stations_alone_ask_for_is_constant() {
    let mut desk = Desk::without_packs();
    for id in ParameterId::all().filter(|id| matches!(id, ParameterId::GroundStation(_))) {
        assert_refused(&mut desk, id, id.default_value() + 1.0, READ_ONLY);
        assert_eq!(desk.parameters().get(id), id.default_value());
    }
}

#[test]
fn a_hidden_parameter_is_set_by_name_and_listed_while_its_pack_is_enabled() {
    let mut desk = Desk::without_packs();
    let by_default = desk.listed();
    let hidden = BatteryParameter::VoltMult.of(Pack::Ninth);
    let monitor = BatteryParameter::Monitor.of(Pack::Ninth);
    desk.assert_set("BATT9_VOLT_MULT", hidden, 11.0);
    assert_eq!(
        desk.parameters().next_unsaved(),
        Some(Unsaved::Value(hidden, 11.0))
    );
    desk.assert_set("BATT9_MONITOR", monitor, 4.0);
    let index = desk.parameters().listed_index(hidden).expect("it is listed");
    let answer = desk.one_answer(&param_read_by_index(index as i16));
    desk.assert_param_value(&answer, hidden, 11.0);
    assert_eq!(desk.list(|_, _| {}), desk.listed());
    desk.assert_set("BATT9_MONITOR", monitor, 0.0);
    assert_eq!(desk.list(|_, _| {}), by_default);
}

/// Sets the monitor of a pack while a list is on its way, when `trigger` has been sent.
fn list_while(trigger: &str, pack: Pack, monitor: f32) -> (Vec<String>, Vec<String>) {
    let mut desk = Desk::without_packs();
    // Slowly: the parameters leave one by one.
    desk.connect_slowly(LinkKind::Radio, 960);
    let fifth: ParameterId = BatteryParameter::Monitor.of(Pack::Fifth);
    desk.set(fifth, 3.0);
    let mut listed = desk.list(|sent, parameters| {
        if sent == trigger {
            let _ = parameters.set(BatteryParameter::Monitor.of(pack), monitor);
        }
    });
    let sent = listed.len();
    listed.sort();
    listed.dedup();
    assert_eq!(listed.len(), sent, "something was sent twice");
    let mut visible = desk.listed();
    visible.sort();
    (listed, visible)
}

#[test]
fn a_list_is_complete_though_packs_are_enabled_and_disabled_meanwhile() {
    for trigger in ["SYSID_THISMAV", "BATT_MONITOR", "BATT5_VOLT_PIN", "BATT9_MONITOR"] {
        // Before the place the list has come to, and behind it.
        for pack in [Pack::Second, Pack::Ninth] {
            let (listed, visible) = list_while(trigger, pack, 4.0);
            assert_eq!(listed, visible, "{pack:?} after {trigger}");
        }
        // A parameter that was sent before it was hidden can't be taken back.
        for pack in [Pack::First, Pack::Fifth] {
            let (listed, visible) = list_while(trigger, pack, 0.0);
            assert!(
                visible.iter().all(|name| listed.contains(name)),
                "{pack:?} after {trigger}"
            );
        }
    }
}

#[test]
fn messages_for_others_are_ignored() {
    let mut desk = Desk::without_packs();
    for target in [[2, 1], [1, 2], [255, 190], [2, 0], [0, 2]] {
        assert_eq!(desk.ask(&param_set_to(target, "SR0_EXTRA1", 10.0)), []);
        assert_eq!(desk.ask(&param_request_list(target)), []);
    }
    for target in [[1, 0], [0, 1]] {
        assert_eq!(desk.ask(&param_set_to(target, "SR0_EXTRA1", 10.0)).len(), 1);
    }
}

#[test]
fn mavlink_1_is_understood() {
    let mut desk = Desk::without_packs();
    let request = encode_v1(23, &param_set_payload(VEHICLE, "SR0_EXTRA1", 7.0));
    let answer = desk.one_answer(&request);
    desk.assert_param_value(&answer, EXTRA1, 7.0);
}

#[test]
fn a_signed_frame_is_taken_with_its_signature() {
    let mut desk = Desk::without_packs();
    // Signatures aren't checked, so any 13 bytes will do: here a request, which must not be taken for one.
    let mut signature = encode_v1(21, &EVERYONE);
    signature.resize(13, 0xfd);
    let list = encode_v2_with_flags(1, PARAM_REQUEST_LIST, &VEHICLE);
    let bytes = [list, signature, param_read_by_index(0)].concat();
    let events = desk.receive_in_chunks(&bytes, 7);
    assert_eq!(events, [Event::ListRequested, Event::Answered]);
}

#[test]
fn a_frame_with_flags_we_do_not_know_is_not_taken() {
    for flags in [2, 3, 0x80] {
        let mut desk = Desk::without_packs();
        let list = encode_v2_with_flags(flags, PARAM_REQUEST_LIST, &VEHICLE);
        let bytes = [list, vec![0; 293]].concat();
        assert_eq!(desk.receive_in_chunks(&bytes, 64), [], "{flags}");
    }
}

#[test]
fn ping_and_timesync_are_answered_and_answers_to_them_are_not() {
    let mut desk = Desk::without_packs();
    let pong = desk.one_answer(&ping(123_456, 7));
    assert_eq!((pong.message_id, pong.u32(0), pong.u32(8)), (PING, 123_456, 7));
    assert_eq!([pong.u8(12), pong.u8(13)], GROUND_STATION);
    let time = desk.one_answer(&timesync(42));
    assert_eq!((time.message_id, time.u32(8)), (TIMESYNC, 42));

    let answer = [&1_u64.to_le_bytes()[..], &8_u32.to_le_bytes(), &VEHICLE].concat();
    assert_eq!(desk.ask(&encode_v2(PING, &answer)), []);
    let answer = [5_i64, 6].map(i64::to_le_bytes).concat();
    assert_eq!(desk.ask(&encode_v2(TIMESYNC, &answer)), []);
}

#[test]
fn commands_are_executed_denied_or_unsupported() {
    // 65535 is a command of no dialect.
    for (number, param1, result) in [
        (PREFLIGHT_STORAGE, 2.0, ACCEPTED),
        (PREFLIGHT_REBOOT_SHUTDOWN, 1.0, ACCEPTED),
        (PREFLIGHT_REBOOT_SHUTDOWN, f32::NAN, DENIED),
        (65535, 1.0, UNSUPPORTED),
    ] {
        let mut desk = Desk::without_packs();
        assert_ack(&desk.one_answer(&command_long(number, param1)), number, result);
        assert_ack(&desk.one_answer(&command_int(number, param1)), number, result);
    }
}

#[test]
fn versions_are_reported_by_whatever_command_asks_for_them() {
    const REQUEST_PROTOCOL_VERSION: u16 = 519;
    const REQUEST_CAPABILITIES: u16 = 520;
    let mut desk = Desk::without_packs();
    for (number, param1, message) in [
        (REQUEST_MESSAGE, 148.0, AUTOPILOT_VERSION),
        (REQUEST_CAPABILITIES, 1.0, AUTOPILOT_VERSION),
        (REQUEST_MESSAGE, 300.0, PROTOCOL_VERSION),
        (REQUEST_PROTOCOL_VERSION, 1.0, PROTOCOL_VERSION),
    ] {
        let number_bytes = number.to_le_bytes();
        let to_everyone = [&f32::to_le_bytes(param1)[..], &[0; 24], &number_bytes, &EVERYONE].concat();
        for request in [
            command_long(number, param1),
            command_int(number, param1),
            encode_v2(COMMAND_LONG, &to_everyone),
        ] {
            let answers = desk.ask(&request);
            assert_ack(&answers[0], number, ACCEPTED);
            assert_eq!((answers.len(), answers[1].message_id), (2, message));
            match message {
                // PARAM_FLOAT, COMMAND_INT, FTP, MAVLINK2, PARAM_ENCODE_C_CAST.
                AUTOPILOT_VERSION => assert_eq!(answers[1].u32(0), 2 | 8 | 32 | 8192 | 131_072),
                _ => assert_eq!([0, 2, 4].map(|at| answers[1].u16(at)), [200, 100, 200]),
            }
        }
    }
}

#[test]
fn modes_are_listed_by_index_or_together() {
    let mut desk = Desk::without_packs();
    let (manual, hold) = ((1, 0, "Manual".to_owned()), (2, 4, "Hold".to_owned()));
    for (index, expected) in [
        (1.0, vec![manual.clone()]),
        (2.0, vec![hold.clone()]),
        (0.0, vec![manual, hold]),
        (3.0, vec![]),
    ] {
        let result = if expected.is_empty() { DENIED } else { ACCEPTED };
        let answers = command(
            &mut desk,
            REQUEST_MESSAGE,
            [AVAILABLE_MODES as f32, index],
            result,
        );
        let modes = answers.iter().map(|mode| {
            assert_eq!((mode.message_id, mode.u8(8)), (AVAILABLE_MODES, 2));
            (mode.u8(9), mode.u32(0), mode.text(11, 35))
        });
        assert_eq!(modes.collect::<Vec<_>>(), expected, "{index}");
    }
}

fn healthy() -> BatteryState {
    builders::healthy(11.1)
}

/// Instances 0 and 2 are monitored.
fn packs_with_a_gap() -> [BatteryState; 4] {
    let none = BatteryState::disabled();
    [healthy(), none, healthy(), none]
}

#[test]
// Requirement: AP-31
fn a_ground_station_switches_solar_chargers_by_their_function_alone() {
    const DO_AUX_FUNCTION: u16 = 218;
    const DRONE_CAN: f32 = 8.0;
    for (function, position, result, switched) in [
        (172.0, 2.0, ACCEPTED, Some(ChargerPower::On)),
        (172.0, 0.0, ACCEPTED, Some(ChargerPower::Off)),
        (172.0, 1.0, ACCEPTED, None),
        (172.0, 3.0, DENIED, None),
        (9.0, 2.0, UNSUPPORTED, None),
    ] {
        let mut desk = Desk::starting(start_with(&[("BATT2_MONITOR", DRONE_CAN)]));
        let answers = command(&mut desk, DO_AUX_FUNCTION, [function, position], result);
        assert_eq!(answers, []);
        assert_eq!(
            desk.autopilot.can_settings().switched,
            switched,
            "{function} {position}"
        );
        assert_eq!(desk.autopilot.can_settings().switched, None, "once");
    }
    let mut desk = Desk::without_packs();
    assert_eq!(command(&mut desk, DO_AUX_FUNCTION, [172.0, 2.0], FAILED), []);
}

#[test]
// Requirement: AP-16
fn a_battery_reset_reaches_the_packs_that_exist() {
    for (mask, result, reset) in [
        (4.0, ACCEPTED, Some(4)),
        (13.0, ACCEPTED, Some(5)),
        (-1.0, FAILED, Some(5)),
        (2.0, FAILED, None),
        (f32::NAN, DENIED, None),
    ] {
        for request in [
            command_long_2(BATTERY_RESET, mask, 56.0),
            command_int_2(BATTERY_RESET, mask, 56.0),
        ] {
            let mut desk = Desk::with_packs(&packs_with_a_gap());
            let events = desk.receive_in_chunks(&request, 64);
            let expected = match reset {
                Some(mask) => Event::Command(Action::ResetBatteries {
                    packs: PackSet::from_bits(mask),
                    percent: 56.0,
                }),
                None => Event::CommandRefused(BATTERY_RESET),
            };
            assert_eq!(events, [expected], "{mask}");
            let answers = desk.sent();
            assert_eq!(answers.len(), 1);
            assert_ack(&answers[0], BATTERY_RESET, result);
        }
    }
}

#[test]
// Requirement: AP-25
fn battery_status_is_requested_by_instance() {
    let mut desk = Desk::with_packs(&packs_with_a_gap());
    for (message, instance_at) in [
        (BATTERY_STATUS, 32),
        (BATTERY_STATUS_V2, 26),
        (SMART_BATTERY_INFO, 18),
        (BATTERY_INFO, 44),
    ] {
        for instance in [0, 2] {
            let answer = requested(&mut desk, message, f32::from(instance));
            assert_eq!(answer.u8(instance_at), instance);
        }
        assert_denied(&mut desk, message, &[1.0, 3.0, 4.0]);
    }
}

#[test]
// Requirement: AP-25
fn a_stream_that_is_off_is_sent_on_request() {
    let mut desk = Desk::with_packs(&packs_with_a_gap());
    desk.set(EXTRA1, 0.0);
    for message in [SYS_STATUS, BATTERY_STATUS] {
        assert_eq!(counts(&sent_for(&mut desk, 2), [message]), [0]);
        requested(&mut desk, message, f32::NAN);
    }
}

#[test]
fn an_interval_is_sent_on_request() {
    let mut desk = Desk::with_packs(&packs_with_a_gap());
    sent_for(&mut desk, 1);
    let asked = [BATTERY_STATUS as f32, f32::NAN];
    let [interval] = &command(&mut desk, GET_MESSAGE_INTERVAL, asked, ACCEPTED)[..] else {
        panic!("one message");
    };
    assert_eq!(interval.message_id, MESSAGE_INTERVAL);
    assert_eq!((interval.i32(0), interval.u16(4)), (500_000, 147));
}

/// The frames that are sent at due times from `desk.now_us` on, for this many seconds.
fn sent_for(desk: &mut Desk, seconds: u64) -> Vec<Frame> {
    sent_until(desk, desk.now_us + seconds * 1_000_000, usize::MAX)
}

/// The frames that are sent at due times until a time, by a link that is free for `messages` at each due time.
fn sent_until(desk: &mut Desk, until_us: u64, messages: usize) -> Vec<Frame> {
    let mut sent = Vec::new();
    while desk.next_due_us() < until_us {
        desk.post_due(desk.next_due_us());
        sent.extend(desk.sent_at_most(messages));
    }
    desk.now_us = until_us;
    sent
}

/// A reading of each frame of a message.
fn of_each<T>(frames: &[Frame], message: u32, read: impl Fn(&Frame) -> T) -> Vec<T> {
    of_message(frames, message).into_iter().map(read).collect()
}

fn counts<const N: usize>(frames: &[Frame], messages: [u32; N]) -> [usize; N] {
    messages.map(|message| of_message(frames, message).len())
}

/// QGroundControl asks for the newer messages, and once they come it turns the older one off.
#[test]
// Requirement: V2-6
fn a_ground_station_moves_over_to_the_newer_messages() {
    const MESSAGES: [u32; 4] = [
        BATTERY_STATUS,
        BATTERY_STATUS_V2,
        SMART_BATTERY_INFO,
        BATTERY_INFO,
    ];
    let mut desk = Desk::with_packs(&[healthy(), healthy()]);
    assert_eq!(counts(&sent_for(&mut desk, 60), MESSAGES), [240, 0, 0, 0]);

    set_interval(&mut desk, BATTERY_STATUS_V2, 1_000_000.0);
    set_interval(&mut desk, BATTERY_INFO, 10_000_000.0);
    assert_eq!(counts(&sent_for(&mut desk, 60), MESSAGES), [240, 120, 0, 12]);
    set_interval(&mut desk, BATTERY_STATUS, -1.0);
    assert_eq!(counts(&sent_for(&mut desk, 60), MESSAGES), [0, 120, 0, 12]);
    set_interval(&mut desk, BATTERY_STATUS_V2, 0.0);
    assert_eq!(counts(&sent_for(&mut desk, 60), MESSAGES), [0, 0, 0, 12]);
    assert_eq!(desk.statistics().dropped, 0);
}

/// A link whose radio has reported a full buffer 40 times, or another sender has.
fn after_forty_reports(kind: LinkKind, sender: [u8; 2]) -> Desk {
    let mut desk = Desk::with_packs(&[healthy()]);
    desk.connect(kind);
    for _ in 0..40 {
        desk.receive_in_chunks(&radio_status_from(sender, 0), 64);
    }
    desk
}

/// A SiK radio, one that passes Wi-Fi on (`MAV_COMP_ID_UDP_BRIDGE`) with the vehicle's or a ground station's system id.
const RADIOS: [[u8; 2]; 4] = [SIK_RADIO, [255, 68], [1, 240], [255, 240]];

#[test]
// Requirement: AP-25, L-15
fn telemetry_slows_down_by_two_seconds_at_most_and_only_until_the_radio_is_silent() {
    for sender in RADIOS {
        let mut desk = after_forty_reports(LinkKind::Radio, sender);
        // One every 2.5 s, the first at once.
        assert_eq!(
            counts(&sent_for(&mut desk, 5), [BATTERY_STATUS, HEARTBEAT]),
            [2, 5]
        );
        assert_eq!(
            counts(&sent_for(&mut desk, 60), [BATTERY_STATUS, HEARTBEAT]),
            [120, 60]
        );
    }
}

#[test]
fn radio_status_counts_from_a_radio_on_a_link_that_can_have_one() {
    let not_radios =
        [[1, 1], GROUND_STATION, [1, 191], [SIK_RADIO[0], 1]].map(|sender| (LinkKind::Radio, sender));
    let by_cable = RADIOS.map(|sender| (LinkKind::Direct, sender));
    let by_wifi = RADIOS.map(|sender| (LinkKind::Wifi, sender));
    for (kind, sender) in not_radios.into_iter().chain(by_cable).chain(by_wifi) {
        let mut desk = after_forty_reports(kind, sender);
        let sent = sent_for(&mut desk, 5);
        assert_eq!(counts(&sent, [BATTERY_STATUS]), [10], "{kind:?} {sender:?}");
    }
}

fn with_cycles(cycle_count: u16) -> BatteryState {
    BatteryState {
        details: PackDetails {
            cycle_count: Some(cycle_count),
            ..PackDetails::default()
        },
        ..healthy()
    }
}

#[test]
fn fuel_status_is_sent_for_tanks_only_and_only_on_request() {
    let without_capacity = BatteryState {
        capacity: None,
        ..tank()
    };
    let packs = [healthy(), tank(), without_capacity, tank(), on_board_only(tank())];
    let mut desk = Desk::with_packs(&packs);
    assert_eq!(counts(&sent_for(&mut desk, 60), [FUEL_STATUS]), [0]);
    for instance in [1, 3] {
        let answer = requested(&mut desk, FUEL_STATUS, f32::from(instance));
        assert_eq!(answer.u8(24), instance);
    }
    assert_denied(&mut desk, FUEL_STATUS, &[0.0, 2.0, 4.0, 5.0]);

    set_interval(&mut desk, FUEL_STATUS, 10_000_000.0);
    let of_tanks = of_each(&sent_for(&mut desk, 60), FUEL_STATUS, |frame| frame.u8(24));
    assert_eq!(of_tanks, [1, 3].repeat(6));
    assert_eq!(desk.statistics().dropped, 0);
}

/// The cycle counts that were sent without a request in ten seconds, with the instance, by BATTERY_INFO and by SMART_BATTERY_INFO.
fn sent_cycles(desk: &mut Desk) -> Vec<(u8, u16)> {
    let sent = sent_for(desk, 10);
    let info = of_each(&sent, BATTERY_INFO, |frame| (frame.u8(44), frame.u16(40)));
    let smart = of_each(&sent, SMART_BATTERY_INFO, |frame| (frame.u8(18), frame.u16(8)));
    assert_eq!(info, smart);
    info
}

#[test]
// Requirement: V2-5
fn smart_battery_details_are_sent_once_per_change() {
    let mut desk = Desk::with_packs(&[healthy(), with_cycles(7), on_board_only(with_cycles(9))]);
    assert_eq!(sent_cycles(&mut desk), [(1, 7)]);
    assert_eq!(sent_cycles(&mut desk), []);
    desk.change_battery(Pack::Second, |battery| battery.readings.voltage_v = Some(10.0));
    assert_eq!(sent_cycles(&mut desk), []);
    desk.change_battery(Pack::Second, |battery| *battery = with_cycles(8));
    assert_eq!(sent_cycles(&mut desk), [(1, 8)]);
    desk.change_battery(Pack::Second, |battery| battery.details = PackDetails::default());
    assert_eq!(sent_cycles(&mut desk), []);
    desk.set_batteries(&[with_cycles(8); 3]);
    assert_eq!(sent_cycles(&mut desk), [(0, 8), (2, 8)]);

    // Another link gets them once, too, however late it is opened.
    desk.connect(LinkKind::Radio);
    assert_eq!(sent_cycles(&mut desk), [(0, 8), (1, 8), (2, 8)]);
    assert_eq!(sent_cycles(&mut desk), []);
}

#[test]
fn battery_info_is_sent_again_of_a_pack_that_was_swapped_or_whose_cells_were_detected() {
    let mut desk = Desk::with_packs(&[healthy(), healthy()]);
    let swap = |desk: &mut Desk| desk.change_battery(Pack::Second, |battery| battery.revision += 1);
    swap(&mut desk);
    assert!(
        described(&sent_for(&mut desk, 10)).is_empty(),
        "it was sent to no station"
    );
    requested(&mut desk, BATTERY_INFO, 1.0);
    for _ in 0..2 {
        swap(&mut desk);
        assert_eq!(described(&sent_for(&mut desk, 10)), [1]);
        assert!(described(&sent_for(&mut desk, 10)).is_empty());
    }
}

#[test]
fn news_of_a_pack_that_is_streamed_anyway_is_no_drop() {
    let mut desk = Desk::with_packs(&[with_cycles(7)]);
    set_interval(&mut desk, BATTERY_INFO, 1_000_000.0);
    assert_eq!(
        counts(&sent_for(&mut desk, 10), [SMART_BATTERY_INFO, BATTERY_INFO]),
        [1, 10]
    );
    assert_eq!(desk.statistics().dropped, 0);
}

/// The instances of BATTERY_INFO, after asserting that SMART_BATTERY_INFO was sent of the same.
fn described(sent: &[Frame]) -> Vec<u8> {
    let info = of_each(sent, BATTERY_INFO, |frame| frame.u8(44));
    assert_eq!(of_each(sent, SMART_BATTERY_INFO, |frame| frame.u8(18)), info);
    info
}

/// The packs that are described in `seconds` in which these senders, in turn, send a HEARTBEAT a second each.
fn described_to(desk: &mut Desk, kind: u8, senders: &[[u8; 2]], seconds: u64) -> Vec<u8> {
    let mut sent = Vec::new();
    for _ in 0..seconds {
        for sender in senders {
            desk.receive_in_chunks(&heartbeat_from(*sender, kind), 64);
        }
        sent.extend(sent_for(desk, 1));
    }
    described(&sent)
}

#[test]
fn smart_batteries_are_described_to_each_new_ground_station_once() {
    const OTHER_STATION: [u8; 2] = [255, 230];
    let internal = on_board_only(with_cycles(3));
    let mut desk = Desk::with_packs(&[with_cycles(1), internal, with_cycles(2), healthy()]);
    let mut described_to = |kind, senders: &[_], seconds| described_to(&mut desk, kind, senders, seconds);
    assert_eq!(described_to(GCS, &[], 10), [0, 2], "on change");
    assert_eq!(described_to(ONBOARD_CONTROLLER, &[[1, 191]], 20), [0_u8; 0]);
    assert_eq!(described_to(GCS, &[GROUND_STATION], 1), [0, 2]);
    assert_eq!(described_to(GCS, &[GROUND_STATION], 100), [0_u8; 0]);
    assert_eq!(described_to(GCS, &[GROUND_STATION, OTHER_STATION], 100), [0, 2]);
    assert_eq!(described_to(GCS, &[], 31), [0_u8; 0]);
    assert_eq!(described_to(GCS, &[OTHER_STATION], 100), [0, 2]);
    desk.connect(LinkKind::Radio);
    assert_eq!(described(&sent_for(&mut desk, 10)), [0, 2], "on change");
    let again = self::described_to(&mut desk, GCS, &[OTHER_STATION], 100);
    assert_eq!(again, [0, 2], "it is new on another link");
    assert_eq!(desk.statistics().dropped, 0);
}

#[test]
// Requirement: V2-5
fn descriptions_come_every_ten_seconds_by_the_default_interval() {
    let mut desk = Desk::with_packs(&[healthy(), healthy()]);
    for (interval_us, expected) in [(0.0, 6), (20_000_000.0, 3), (-1.0, 0)] {
        for message in [BATTERY_INFO, SMART_BATTERY_INFO] {
            set_interval(&mut desk, message, interval_us);
        }
        assert_eq!(described(&sent_for(&mut desk, 60)), [0, 1].repeat(expected));
    }
}

/// The names and values of NAMED_VALUE_FLOAT.
fn named_values(sent: &[Frame]) -> Vec<(String, f32)> {
    of_each(sent, NAMED_VALUE_FLOAT, |frame| (frame.text(8, 10), frame.f32(4)))
}

#[test]
fn estimates_are_sent_on_request_while_they_are_known() {
    let mut known = healthy();
    known.resistance_ohm = Some(0.0625);
    known.readings.resting_voltage_v = Some(11.5);
    known.readings.remaining_sigma_pct = Some(3.5);
    known.readings.usable_pct = Some(18.75);
    let mut resistance_only = known;
    resistance_only.readings.resting_voltage_v = None;
    resistance_only.readings.remaining_sigma_pct = None;
    resistance_only.readings.usable_pct = None;
    let unused = BatteryState {
        status: PackStatus::Disabled,
        ..known
    };
    let mut desk = Desk::with_packs(&[known, healthy(), resistance_only, unused]);
    assert_eq!(named_values(&sent_for(&mut desk, 60)), []);

    let of_first = [
        ("BAT1_RES".into(), 62.5),
        ("BAT1_VREST".into(), 11.5),
        ("BAT1_SIGMA".into(), 3.5),
        ("BAT1_USABL".into(), 18.75),
    ];
    let of_third = [("BAT3_RES".into(), 62.5)];
    for (instance, expected) in [(0.0, &of_first[..]), (f32::NAN, &of_first), (2.0, &of_third)] {
        let asked = [NAMED_VALUE_FLOAT as f32, instance];
        let answers = command(&mut desk, REQUEST_MESSAGE, asked, ACCEPTED);
        assert_eq!(named_values(&answers), expected);
        assert_eq!(answers.len(), expected.len());
        assert_eq!(
            answers[0].u32(0),
            (desk.now_us / 1000) as u32,
            "ms since the start"
        );
    }
    assert_denied(&mut desk, NAMED_VALUE_FLOAT, &[1.0, 3.0, 4.0, 9.0]);

    set_interval(&mut desk, NAMED_VALUE_FLOAT, 1_000_000.0);
    let once = ["BAT1_RES", "BAT3_RES", "BAT1_VREST", "BAT1_SIGMA", "BAT1_USABL"];
    let names = |sent: &[Frame]| of_each(sent, NAMED_VALUE_FLOAT, |frame| frame.text(8, 10));
    assert_eq!(names(&sent_for(&mut desk, 5)), once.repeat(5));
    desk.change_battery(Pack::First, |battery| battery.resistance_ohm = None);
    assert_eq!(
        names(&sent_for(&mut desk, 2)),
        ["BAT3_RES", "BAT1_VREST", "BAT1_SIGMA", "BAT1_USABL"].repeat(2)
    );
    // By default it is off.
    set_interval(&mut desk, NAMED_VALUE_FLOAT, 0.0);
    assert_eq!(named_values(&sent_for(&mut desk, 60)), []);
    assert_eq!(desk.statistics().dropped, 0);
}

/// The number of BATTERY_STATUS of each instance, and that of SYS_STATUS.
fn count(frames: &[Frame]) -> ([usize; MAX_PACKS], usize) {
    let mut packs = [0; MAX_PACKS];
    for frame in of_message(frames, BATTERY_STATUS) {
        packs[usize::from(BatteryStatus(frame).instance())] += 1;
    }
    (packs, of_message(frames, SYS_STATUS).len())
}

#[test]
fn nine_packs_are_each_sent_at_the_full_rate() {
    for rate_hz in [1, 2, 10, 50] {
        let mut desk = Desk::with_packs(&[healthy(); MAX_PACKS]);
        desk.set(EXTRA1, rate_hz as f32);
        let (packs, sys_status) = count(&sent_for(&mut desk, 60));
        assert_eq!(packs, [60 * rate_hz; MAX_PACKS]);
        assert_eq!(sys_status, 60 * rate_hz);
        assert_eq!(desk.statistics().dropped, 0);
    }
}

#[test]
fn what_waits_says_how_things_are_when_it_leaves() {
    let mut desk = Desk::with_packs(&[healthy(); 3]);
    desk.post_due(0);
    desk.change_battery(Pack::First, |battery| battery.readings.voltage_v = Some(10.0));
    desk.change_battery(Pack::Second, |battery| *battery = on_board_only(*battery));
    desk.change_battery(Pack::Third, |battery| battery.status = PackStatus::Disabled);
    // The link's counters are those of that moment, too.
    desk.endpoint.count_overrun();
    let sent = desk.sent();
    let voltages = of_each(&sent, BATTERY_STATUS, |frame| {
        (
            BatteryStatus(frame).instance(),
            BatteryStatus(frame).voltage_mv(0),
        )
    });
    assert_eq!(
        voltages,
        [(0, 10_000)],
        "no word of packs that are not reported any more"
    );
    assert_eq!(SysStatus(of_message(&sent, SYS_STATUS)[0]).errors_comm(), 1);
    assert_eq!(desk.statistics().sent, 3);
}

#[test]
fn an_interval_holds_for_all_packs_at_once() {
    let mut desk = Desk::with_packs(&[healthy(); MAX_PACKS]);
    set_interval(&mut desk, BATTERY_STATUS, 100_000.0);
    let (packs, sys_status) = count(&sent_for(&mut desk, 60));
    assert_eq!((packs, sys_status), ([600; MAX_PACKS], 120));
}

#[test]
fn a_pack_that_is_not_reported_is_not_sent() {
    let mut desk = Desk::with_packs(&[
        healthy(),
        BatteryState::disabled(),
        on_board_only(healthy()),
        BatteryState::default(),
    ]);
    let (packs, sys_status) = count(&sent_for(&mut desk, 60));
    assert_eq!((packs, sys_status), ([120, 0, 0, 120, 0, 0, 0, 0, 0], 120));
}

#[test]
fn nine_packs_share_a_link_that_is_too_slow_evenly_and_heartbeat_goes_first() {
    for messages in 1..10 {
        let mut desk = Desk::with_packs(&[healthy(); MAX_PACKS]);
        let sent = sent_until(&mut desk, 600_000_000, messages);
        // HEARTBEAT is due at every other due time of the streams.
        assert_eq!(of_message(&sent, HEARTBEAT).len(), 600);
        let (packs, sys_status) = count(&sent);
        let most = packs.iter().copied().fold(sys_status, usize::max);
        let least = packs.iter().copied().fold(sys_status, usize::min);
        assert!(
            most - least <= 1 && least > 0,
            "{messages}: {packs:?}, {sys_status}"
        );
        let waiting = desk.sent().len();
        let dropped = 1200 * 10 - packs.iter().sum::<usize>() - sys_status - waiting;
        assert_eq!(desk.statistics().dropped as usize, dropped);
    }
}

#[test]
fn a_long_text_leaves_in_chunks() {
    let mut desk = Desk::without_packs();
    desk.endpoint.say(Severity::Warning, &"x".repeat(70));
    desk.endpoint.say(Severity::Info, "short");
    let texts = desk.sent();
    assert!(texts.iter().all(|frame| frame.message_id == STATUSTEXT));
    let parts = of_each(&texts, STATUSTEXT, |frame| {
        (frame.u8(0), frame.text(1, 50).len(), frame.u16(51), frame.u8(53))
    });
    assert_eq!(parts, [(4, 50, 1, 0), (4, 20, 1, 1), (6, 5, 0, 0)]);
}

/// Bytes that try a parser: start bytes, lengths and ids of real messages, and anything.
fn garbage() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![3 => Just(0xfd), 1 => Just(0xfe), 2 => Just(0), 1 => 0u8..40, 3 => any::<u8>()];
    prop::collection::vec(byte, 0..600)
}

/// A false start in 65536 has a right checksum by accident. What it covers is its payload, a request included.
fn swallowed(events: &[Event]) -> bool {
    !events.is_empty() && events.iter().all(|event| *event == Event::Ignored)
}

const STREAM_ALL: u8 = 0;
const STREAM_EXTENDED_STATUS: u8 = 2;
const STREAM_EXTRA1: u8 = 10;
const STREAM_EXTRA3: u8 = 12;

/// The numbers of SYS_STATUS and BATTERY_STATUS of the first pack that are sent in ten seconds.
fn status_rates(desk: &mut Desk) -> [usize; 2] {
    counts(&sent_for(desk, 10), [SYS_STATUS, BATTERY_STATUS])
}

#[test]
// Requirement: AP-25
fn each_stream_group_moves_its_message_and_the_latest_request_counts() {
    let mut desk = Desk::with_packs(&[healthy()]);
    assert_eq!(status_rates(&mut desk), [20, 20]);
    for (stream, rate_hz, start_stop, expected) in [
        (STREAM_EXTENDED_STATUS, 5, 1, [50, 20]),
        (STREAM_EXTRA3, 1, 1, [50, 10]),
        (STREAM_EXTRA1, 4, 1, [40, 40]),
        (STREAM_EXTRA3, 10, 1, [40, 100]),
        (STREAM_ALL, 2, 1, [20, 20]),
        (STREAM_EXTENDED_STATUS, u16::MAX, 1, [500, 20]),
        // Without a start, whatever the rate; and a rate of 0.
        (STREAM_EXTENDED_STATUS, 10, 0, [0, 20]),
        (STREAM_EXTRA3, 0, 1, [0, 0]),
        (STREAM_EXTRA3, 5, 1, [0, 50]),
        (STREAM_ALL, 4, 0, [0, 0]),
        (STREAM_EXTRA1, 1, 1, [10, 10]),
    ] {
        desk.ask(&request_data_stream(stream, rate_hz, start_stop));
        assert_eq!(status_rates(&mut desk), expected, "{stream} at {rate_hz} Hz");
    }
    for other in (0..=u8::MAX).filter(|id| ![0, 2, 10, 12].contains(id)) {
        desk.ask(&request_data_stream(other, 50, 1));
        desk.ask(&request_data_stream(other, 50, 0));
    }
    assert_eq!(status_rates(&mut desk), [10, 10]);
    assert_eq!(desk.parameters().get(EXTRA1), 2.0, "nothing of it is set");

    // Another link has its own rates.
    desk.connect(LinkKind::Radio);
    assert_eq!(status_rates(&mut desk), [20, 20]);
}

/// Its order, with the rates it has by default: SYS_STATUS follows *Attitude*, which comes after *Status*.
#[test]
fn mission_planners_requests_give_the_rate_of_attitude_and_of_sensor() {
    let [raw_sensors, rc_channels, position, extra2] = [1, 3, 6, 11];
    let mut desk = Desk::with_packs(&[healthy()]);
    let round = |desk: &mut Desk, attitude_hz| {
        for (stream, rate_hz) in [
            (STREAM_EXTENDED_STATUS, 2),
            (position, 2),
            (STREAM_EXTRA1, attitude_hz),
            (extra2, attitude_hz),
            (STREAM_EXTRA3, 2),
            (raw_sensors, 2),
            (rc_channels, 2),
        ] {
            // It does not request a rate of 0.
            if rate_hz > 0 {
                desk.ask(&request_data_stream(stream, rate_hz, 1));
            }
        }
        status_rates(desk)
    };
    assert_eq!(round(&mut desk, 0), [20, 20]);
    for _ in 0..3 {
        assert_eq!(round(&mut desk, 4), [40, 20]);
    }
    // *Status* is what it was, and *Attitude* is not requested: nothing changes.
    assert_eq!(round(&mut desk, 0), [40, 20]);
    // A rate that is chosen in its panel holds until the next round.
    desk.ask(&request_data_stream(STREAM_EXTENDED_STATUS, 10, 1));
    assert_eq!(status_rates(&mut desk), [100, 20]);
}

#[test]
fn setting_sr0_extra1_ends_requests_and_a_request_after_it_counts() {
    let mut desk = Desk::with_packs(&[healthy()]);
    for (stream, moved) in [
        (STREAM_EXTENDED_STATUS, [50, 20]),
        (STREAM_EXTRA3, [20, 50]),
        (STREAM_EXTRA1, [50, 50]),
    ] {
        desk.ask(&request_data_stream(stream, 5, 1));
        assert_eq!(status_rates(&mut desk), moved);
        // To the value it has.
        desk.assert_set("SR0_EXTRA1", EXTRA1, 2.0);
        assert_eq!(status_rates(&mut desk), [20, 20]);
        // Repeated, as by a ground station that does so every few seconds.
        desk.ask(&request_data_stream(stream, 5, 1));
        assert_eq!(status_rates(&mut desk), [20, 20]);
        // Before either is followed.
        desk.receive_in_chunks(&param_set("SR0_EXTRA1", 10.0), 64);
        desk.ask(&request_data_stream(stream, 4, 1));
        assert_eq!(
            status_rates(&mut desk),
            moved.map(|rate| if rate == 20 { 100 } else { 40 })
        );
        desk.ask(&request_data_stream(stream, 5, 1));
        desk.assert_set("SR0_EXTRA1", EXTRA1, 2.0);
        assert_eq!(status_rates(&mut desk), [20, 20]);
    }
    // Set on another link: it was set before the request.
    desk.set(EXTRA1, 10.0);
    desk.ask(&request_data_stream(STREAM_EXTRA3, 5, 1));
    assert_eq!(status_rates(&mut desk), [100, 50]);
    desk.set(EXTRA1, 4.0);
    assert_eq!(status_rates(&mut desk), [40, 40]);
}

#[test]
fn an_interval_outranks_stream_requests_until_it_is_put_back() {
    let mut desk = Desk::with_packs(&[healthy()]);
    set_interval(&mut desk, BATTERY_STATUS, -1.0);
    for stream in [STREAM_EXTRA3, STREAM_EXTRA1, STREAM_ALL] {
        desk.ask(&request_data_stream(stream, 5, 1));
        assert_eq!(status_rates(&mut desk)[1], 0, "stream {stream}");
    }
    desk.ask(&request_data_stream(STREAM_EXTRA3, 2, 1));
    set_interval(&mut desk, BATTERY_STATUS, 0.0);
    assert_eq!(status_rates(&mut desk), [50, 20], "the latest request of each");
}

const STREAMED: [u32; 8] = [
    HEARTBEAT,
    SYS_STATUS,
    BATTERY_STATUS,
    BATTERY_STATUS_V2,
    SMART_BATTERY_INFO,
    FUEL_STATUS,
    BATTERY_INFO,
    NAMED_VALUE_FLOAT,
];

/// The result of SET_MESSAGE_INTERVAL.
fn result_of_interval(message: u32, interval_us: f32) -> u8 {
    let is_allowed = match message {
        HEARTBEAT => [0.0, 1e6].contains(&interval_us),
        _ => [-1.0, 0.0].contains(&interval_us) || (20_000.0..=1.8e9).contains(&interval_us),
    };
    match is_allowed {
        _ if !STREAMED.contains(&message) => UNSUPPORTED,
        true => ACCEPTED,
        false => DENIED,
    }
}

/// A name, the frame, and the result of its acknowledgement: REQUEST_DATA_STREAM has none.
type RateRequest = (String, Vec<u8>, Option<u8>);

/// A request that changes the rates of a link.
fn rate_request() -> impl Strategy<Value = RateRequest> {
    let message = prop_oneof![4 => prop::sample::select(&STREAMED[..]), 1 => 0u32..1 << 24];
    let extremes = [
        -1.0,
        0.0,
        1.0,
        19_999.0,
        20_000.0,
        1e6,
        1.8e9,
        f32::MAX,
        f32::NAN,
        f32::INFINITY,
    ];
    let interval = prop_oneof![prop::sample::select(extremes.to_vec()), 0f32..1e6, any::<f32>()];
    let rate = prop_oneof![prop::sample::select(vec![0, 1, 50, u16::MAX]), any::<u16>()];
    prop_oneof![
        (message, interval).prop_map(|(message, interval_us)| (
            format!("{message} every {interval_us} us"),
            command_long_2(SET_MESSAGE_INTERVAL, message as f32, interval_us),
            Some(result_of_interval(message, interval_us)),
        )),
        (prop::sample::select(vec![0u8, 2, 10, 12, 255]), rate, 0u8..3).prop_map(
            |(stream, rate_hz, start_stop)| (
                format!("stream {stream} at {rate_hz} Hz: {start_stop}"),
                request_data_stream(stream, rate_hz, start_stop),
                None,
            )
        ),
    ]
}

proptest! {
    /// Each is answered as it would be alone, the heartbeat keeps its rate, and nothing else exceeds 50 Hz.
    #[test]
    // Requirement: L-17
    fn rates_asked_for_again_and_again_stay_within_their_bounds(
        requests in prop::collection::vec((rate_request(), 1usize..50, 0u64..100_000), 1..50),
    ) {
        let mut desk = Desk::with_packs(&[healthy()]);
        let mut last_us = HashMap::new();
        for ((name, request, result), repetitions, wait_us) in requests {
            for _ in 0..repetitions {
                let answers = desk.ask(&request);
                let results: Vec<_> = of_message(&answers, COMMAND_ACK).iter().map(|ack| ack.u8(2)).collect();
                prop_assert_eq!((answers.len(), results), (result.iter().len(), Vec::from_iter(result)), "{}", name);
                let until_us = desk.now_us + wait_us;
                while desk.next_due_us() < until_us {
                    let due_us = desk.next_due_us();
                    desk.post_due(due_us);
                    for frame in desk.sent() {
                        let Some(before_us) = last_us.insert(frame.message_id, due_us) else {
                            continue;
                        };
                        let interval_us = due_us - before_us;
                        match frame.message_id {
                            HEARTBEAT => prop_assert_eq!(interval_us, 1_000_000),
                            other => prop_assert!(interval_us >= 20_000, "{} of {}", interval_us, other),
                        }
                    }
                }
                desk.now_us = until_us;
            }
        }
    }

    /// A report may come at any time, so the silence begins with the last one.
    #[test]
    // Requirement: L-15
    fn whatever_radios_report_telemetry_is_back_at_its_rate_after_their_silence(
        rate_hz in 1u16..=50,
        reports in prop::collection::vec(
            (prop::sample::select(&RADIOS[..]), any::<u8>(), 0u64..4_000_000),
            1..100,
        ),
    ) {
        let mut desk = Desk::with_packs(&[healthy()]);
        desk.set(EXTRA1, rate_hz.into());
        for (radio, buffer_free, wait_us) in reports {
            desk.receive_in_chunks(&radio_status_from(radio, buffer_free), 64);
            let until_us = desk.now_us + wait_us;
            sent_until(&mut desk, until_us, usize::MAX);
        }
        sent_for(&mut desk, 6);
        let [sent] = counts(&sent_for(&mut desk, 10), [BATTERY_STATUS]);
        prop_assert!(sent.abs_diff(10 * usize::from(rate_hz)) <= 1, "{} at {} Hz", sent, rate_hz);
    }

    /// Whatever comes first, a request is answered as soon as the parser has no room for more or the sender pauses; at the second
    /// attempt if garbage looked like an unknown frame that has the first one in it.
    #[test]
    fn a_request_behind_garbage_is_answered(garbage in garbage(), chunk in 1usize..200) {
        for bytes_behind in [512, 0] {
            let mut desk = Desk::without_packs();
            let request = [param_set("BATT_VOLT_MULT", 4.25), vec![0; bytes_behind]].concat();
            // The garbage may itself be a request by accident, but not this one.
            let mut events = desk.receive_in_chunks(&[&garbage[..], &request].concat(), chunk);
            if bytes_behind == 0 {
                desk.endpoint.give_up_waiting();
                events.extend(desk.handle_all());
            }
            prop_assume!(!swallowed(&events));
            if desk.statistics().received.unknown_messages > 0 {
                events.extend(desk.receive_in_chunks(&request, chunk));
            }
            prop_assert!(events.contains(&Event::ParameterSet(VOLT_MULT)), "{events:?}");
            prop_assert_eq!(desk.parameters().get(VOLT_MULT), 4.25);
        }
    }

    /// The content of a message that is unknown here, or has a flag that is, is no request: neither before another frame nor
    /// before a pause.
    #[test]
    fn a_request_inside_an_unknown_frame_is_not_executed(
        flags in prop_oneof![Just(0u8), Just(1), 2u8..],
        id in prop_oneof![Just(172u32), Just(0x123456), Just(23)],
        before in 0usize..80,
        frames in 1usize..8,
        is_last in any::<bool>(),
        chunk in 1usize..200,
    ) {
        prop_assume!(flags > 1 || id != 23);
        let mut payload = vec![0; before];
        payload.extend(param_set("BATT_VOLT_MULT", 4.25));
        payload.resize(before + 96, 0);
        let [id0, id1, id2, _] = id.to_le_bytes();
        let mut unknown = vec![0xfd, payload.len() as u8, flags, 0, 7, 255, 190, id0, id1, id2];
        unknown.extend(payload);
        unknown.resize(unknown.len() + 2 + if flags & 1 == 1 { 13 } else { 0 }, 0xa5);
        let mut bytes = unknown.repeat(frames);
        if !is_last {
            bytes.extend(param_set("SR0_EXTRA1", 10.0));
        }
        let mut desk = Desk::without_packs();
        let mut events = desk.receive_in_chunks(&bytes, chunk);
        desk.endpoint.give_up_waiting();
        events.extend(desk.handle_all());
        let expected = (!is_last).then_some(Event::ParameterSet(EXTRA1));
        prop_assert_eq!(events, Vec::from_iter(expected));
        prop_assert_eq!(desk.statistics().received.unknown_messages, frames as u32);
    }

    /// The length of the chunks makes no difference.
    #[test]
    fn the_same_bytes_in_other_chunks_do_the_same(garbage in garbage(), chunk in 1usize..300) {
        let bytes = [&garbage[..], &param_read_by_index(2), &garbage, &command_long(999, 0.0), &garbage].concat();
        let (mut desk, mut other) = (Desk::without_packs(), Desk::without_packs());
        prop_assert_eq!(desk.receive_in_chunks(&bytes, 1), other.receive_in_chunks(&bytes, chunk));
        prop_assert_eq!(desk.statistics(), other.statistics());
    }

    /// A frame with any single bit flipped does nothing, unless the bit is one the checksum does not cover.
    #[test]
    fn a_flipped_bit_is_noticed(bit in 8usize..8 * 35) {
        let mut desk = Desk::without_packs();
        let mut frame = param_set("SR0_EXTRA1", 10.0);
        prop_assume!(bit / 8 < frame.len());
        frame[bit / 8] ^= 1 << (bit % 8);
        let events = desk.receive_in_chunks(&[frame, vec![0; 293]].concat(), 64);
        prop_assert!(!events.contains(&Event::ParameterSet(EXTRA1)));
        prop_assert_eq!(desk.parameters().get(EXTRA1), 2.0);
    }

    #[test]
    fn any_bytes_leave_every_parameter_in_range_and_every_answer_a_frame(bytes in garbage(), pause in any::<bool>()) {
        let mut desk = Desk::without_packs();
        desk.receive_in_chunks(&bytes, 64);
        if pause {
            desk.endpoint.give_up_waiting();
        }
        desk.sent();
        for id in ParameterId::all() {
            prop_assert!(id.row().range.contains(desk.parameters().get(id)));
        }
    }
}

#[test]
fn telemetry_goes_on_while_requests_flood_in() {
    let mut desk = Desk::without_packs();
    let flood = param_read_by_index(0).repeat(50);
    desk.receive_in_chunks(&flood, 64);
    desk.post_due(0);
    let sent = desk.sent();
    assert_eq!(sent[0].message_id, HEARTBEAT, "it goes first");
    let answers = of_message(&sent, PARAM_VALUE);
    assert_eq!(answers.len(), 16, "as many as there is room for");
    assert_eq!(desk.statistics().dropped, 34, "the others are counted");
}
