//! One session of a ground station, the same over every wire.

use crate::log::board_id;
use crate::rover::GOOD_3S;
use emulator::LogLevel;
use support::commands::{ACCEPTED, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, UNSUPPORTED};
use support::frames::{
    ARMED, AUTOPILOT_VERSION, BATTERY_STATUS, HEARTBEAT, Heartbeat, PARAM_VALUE, PING, SYS_STATUS, TIMESYNC,
    acknowledged, assert_no_sequence_gap, last_of, of_message,
};
use support::requests::{arm, command_long_2, disarm, ping, timesync};
use workbench::bench::{Bench, LISTED_BY_DEFAULT, SAVED_US, SECOND, TestedVehicle, Wire};
use workbench::runs::rates_asked_for::assert_rates;

const UNKNOWN_COMMAND: u16 = 410;

#[test]
fn a_session_over_the_uart() {
    run(Wire::Uart);
}

#[test]
fn the_same_session_over_usb() {
    run(Wire::Usb);
}

fn run(wire: Wire) {
    let mut bench = Bench::configured(GOOD_3S, &[("BATT_CELLS", 3.0)]);
    bench.use_wire(wire);
    bench.run_until_silent();
    bench.forget_sent();
    receive_telemetry(&mut bench);
    list_and_set_parameters(&mut bench);
    command(&mut bench);
    ask_for_the_time(&mut bench);
    arm_and_disarm(&mut bench);
    assert_no_sequence_gap(&bench.frames());
    let warnings = bench.logged(LogLevel::Warn, "");
    assert!(
        warnings.len() == 1 && warnings[0].1.contains("refused"),
        "{warnings:?}"
    );
    restart(&mut bench);
}

fn receive_telemetry(bench: &mut Bench) {
    let rates = [(HEARTBEAT, 1.0), (SYS_STATUS, 2.0), (BATTERY_STATUS, 2.0)];
    assert_rates(bench, 10 * SECOND, &rates);
    let voltage_mv = last_of(&bench.frames(), 0).voltage_mv(0);
    assert!(voltage_mv.abs_diff(11_402) <= 4, "{voltage_mv} mV");
}

fn list_and_set_parameters(bench: &mut Bench) {
    assert_eq!(bench.list().len(), LISTED_BY_DEFAULT);
    bench.run_for(SECOND);
    let values = of_message(&bench.frames(), PARAM_VALUE).len();
    assert_eq!(values, LISTED_BY_DEFAULT, "each is listed once");
    bench.set("BATT_CAPACITY", 2200.0);
    assert_eq!(bench.parameter("BATT_CAPACITY"), 2200.0);
    bench.run_for(SAVED_US);
}

fn command(bench: &mut Bench) {
    for (number, message, interval_us, result) in [
        (SET_MESSAGE_INTERVAL, BATTERY_STATUS, 100_000.0, ACCEPTED),
        (REQUEST_MESSAGE, AUTOPILOT_VERSION, 0.0, ACCEPTED),
        (UNKNOWN_COMMAND, 0, 0.0, UNSUPPORTED),
    ] {
        let answers = bench.ask(&command_long_2(number, message as f32, interval_us));
        assert_eq!(acknowledged(&answers)[0], (number, result));
    }
    assert_rates(bench, 5 * SECOND, &[(BATTERY_STATUS, 10.0), (HEARTBEAT, 1.0)]);
    let id = board_id(bench);
    let logged = bench.logged(LogLevel::Info, &format!("board {id}"));
    assert_eq!(logged.len(), 2, "two starts");
}

fn ask_for_the_time(bench: &mut Bench) {
    let answers = bench.ask(&ping(1_234, 7));
    let answer = of_message(&answers, PING)[0];
    assert_eq!((answer.u32(0), answer.u32(8)), (1_234, 7));
    let answers = bench.ask(&timesync(42));
    assert_eq!(of_message(&answers, TIMESYNC)[0].u32(8), 42);
}

fn arm_and_disarm(bench: &mut Bench) {
    for (request, armed) in [(arm(), ARMED), (disarm(), 0)] {
        assert_eq!(bench.result_of(&request), ACCEPTED);
        bench.run_for(SECOND);
        let frames = bench.frames();
        let heartbeat = *of_message(&frames, HEARTBEAT).last().expect("it beats");
        assert_eq!(Heartbeat(heartbeat).base_mode() & ARMED, armed);
    }
}

/// What was set is still set, and the wire comes back by itself.
fn restart(bench: &mut Bench) {
    bench.reboot();
    bench.forget_sent();
    bench.run_for(SECOND);
    assert_eq!(bench.parameter("BATT_CAPACITY"), 2200.0);
    assert!(!of_message(&bench.frames(), BATTERY_STATUS).is_empty());
}
