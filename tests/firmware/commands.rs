//! Intervals and requests, through the telemetry port.

use support::commands::{
    ACCEPTED, DENIED, GET_MESSAGE_INTERVAL, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, UNSUPPORTED,
};
use support::frames::{
    AUTOPILOT_VERSION, BATTERY_STATUS, COMMAND_ACK, HEARTBEAT, MESSAGE_INTERVAL, PROTOCOL_VERSION,
    SYS_STATUS, of_message, result_of,
};
use support::requests::{command_int, command_long, command_long_2, param_set, radio_status};
use workbench::bench::{Bench, SECOND};
use workbench::runs::rates_asked_for::{self, assert_rates};

const REQUEST_PROTOCOL_VERSION: u16 = 519;
const REQUEST_AUTOPILOT_CAPABILITIES: u16 = 520;

/// So long rates are counted; longer ones are in `tests/endurance`.
const RATE_US: u64 = 20 * SECOND;

fn running() -> Bench {
    let mut bench = Bench::power_up(2482);
    bench.run_for(SECOND);
    bench
}

#[test]
// Requirement: AP-25
fn an_interval_is_kept_within_one_percent_and_for_its_message_alone() {
    rates_asked_for::by_interval(10 * SECOND);
}

#[test]
fn bad_intervals_are_denied_and_unknown_messages_unsupported() {
    let mut bench = running();
    for interval_us in [-2.0, 100.0, f32::NAN] {
        assert_eq!(
            bench.result_of(&command_long_2(SET_MESSAGE_INTERVAL, 147.0, interval_us)),
            DENIED
        );
    }
    assert_eq!(
        bench.result_of(&command_long_2(SET_MESSAGE_INTERVAL, 30.0, 100_000.0)),
        UNSUPPORTED
    );
    assert_eq!(
        bench.result_of(&command_long(REQUEST_MESSAGE, 242.0)),
        UNSUPPORTED
    );
    assert_eq!(
        bench.result_of(&command_long_2(REQUEST_MESSAGE, 147.0, 5.0)),
        DENIED
    );
    assert_rates(&mut bench, RATE_US, &[(BATTERY_STATUS, 2.0)]);
}

#[test]
fn intervals_and_messages_are_sent_on_request() {
    let mut bench = running();
    let answers = bench.ask(&command_long(GET_MESSAGE_INTERVAL, 147.0));
    assert_eq!(result_of(&answers), ACCEPTED);
    let interval = of_message(&answers, MESSAGE_INTERVAL)[0];
    assert_eq!((interval.i32(0), interval.u16(4)), (500_000, 147));

    for (request, message) in [
        (command_long(REQUEST_MESSAGE, 148.0), AUTOPILOT_VERSION),
        (command_long(REQUEST_MESSAGE, 300.0), PROTOCOL_VERSION),
        (command_int(REQUEST_MESSAGE, 148.0), AUTOPILOT_VERSION),
        (
            command_long(REQUEST_AUTOPILOT_CAPABILITIES, 1.0),
            AUTOPILOT_VERSION,
        ),
        (command_long(REQUEST_PROTOCOL_VERSION, 1.0), PROTOCOL_VERSION),
    ] {
        let answers = bench.ask(&request);
        assert_eq!(result_of(&answers), ACCEPTED);
        assert_eq!(of_message(&answers, message).len(), 1, "message {message}");
    }
    let answers = bench.ask(&command_long(REQUEST_MESSAGE, 148.0));
    let version = of_message(&answers, AUTOPILOT_VERSION)[0];
    // PARAM_FLOAT, COMMAND_INT, FTP, MAVLINK2, PARAM_ENCODE_C_CAST.
    assert_eq!(version.u32(0), 2 | 8 | 32 | 8192 | 131_072);
}

#[test]
fn a_streamed_message_comes_on_request_while_it_is_off() {
    let mut bench = running();
    bench.ask(&param_set("SR0_EXTRA1", 0.0));
    bench.run_for(SECOND);
    for message in [SYS_STATUS, BATTERY_STATUS] {
        let from_us = bench.time_us();
        assert_eq!(
            bench.result_of(&command_long_2(REQUEST_MESSAGE, message as f32, 0.0)),
            ACCEPTED
        );
        let frames = bench.frames();
        let sent = of_message(&frames, message)
            .iter()
            .filter(|frame| frame.at_us > from_us)
            .count();
        assert_eq!(sent, 1, "message {message}");
    }
}

#[test]
fn a_radio_with_a_full_buffer_slows_telemetry_but_not_the_heartbeat() {
    let mut bench = running();
    bench.ask(&param_set("SR0_EXTRA1", 10.0));
    for _ in 0..10 {
        bench.ask(&radio_status(10));
    }
    let from_us = bench.time_us();
    // As long as it reports.
    for _ in 0..21 {
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &radio_status(70));
        bench.run_for(SECOND);
    }
    let frames = bench.frames_since(from_us);
    // 100 ms and ten times 60 ms.
    let slowed = of_message(&frames, BATTERY_STATUS).len();
    assert!(slowed.abs_diff(30) <= 1, "{slowed}");
    assert_eq!(of_message(&frames, HEARTBEAT).len(), 21);
    for _ in 0..40 {
        bench.ask(&radio_status(100));
    }
    assert_rates(&mut bench, RATE_US, &[(BATTERY_STATUS, 10.0)]);
}

#[test]
fn a_thousand_intervals_are_each_acknowledged_and_never_exceed_the_highest_rate() {
    const PAIRS: usize = 500;
    let mut bench = running();
    let from_us = bench.time_us();
    let off_and_on = [-1.0, 20_000.0]
        .map(|interval_us| command_long_2(SET_MESSAGE_INTERVAL, SYS_STATUS as f32, interval_us));
    bench.uart_send(0, from_us, &off_and_on.concat().repeat(PAIRS));
    bench.run_for(5 * SECOND);
    let frames = bench.frames_since(from_us);
    let results: Vec<_> = of_message(&frames, COMMAND_ACK)
        .iter()
        .map(|ack| ack.u8(2))
        .collect();
    assert_eq!(results, [ACCEPTED; 2 * PAIRS]);
    let sent = of_message(&frames, SYS_STATUS).len();
    assert!((200..=251).contains(&sent), "{sent} in 5 s");
    assert_eq!(of_message(&frames, HEARTBEAT).len(), 5);
}
