//! Rates that a ground station has asked for.

use crate::bench::{Bench, DIVIDER_CODE, SAVED_US, SECOND, TestedVehicle};
use support::commands::{ACCEPTED, SET_MESSAGE_INTERVAL};
use support::frames::{BATTERY_STATUS, HEARTBEAT, SYS_STATUS, of_message};
use support::requests::command_long_2;

/// Panics unless each message leaves at its rate for this time, within 1 % or one frame.
pub fn assert_rates(bench: &mut Bench, length_us: u64, expected_hz: &[(u32, f64)]) {
    let from_us = bench.time_us();
    bench.run_for(length_us);
    let frames = bench.frames();
    let seconds = length_us as f64 / SECOND as f64;
    for (message, rate_hz) in expected_hz {
        let received = of_message(&frames, *message);
        let counted = received.iter().filter(|frame| frame.at_us > from_us).count();
        let expected = (rate_hz * seconds).round() as usize;
        assert!(
            counted.abs_diff(expected) <= (expected / 100).max(1),
            "{counted} of {message} in {seconds} s, not {expected}"
        );
    }
}

/// Asks for several intervals of one message.
pub fn by_interval(length_us: u64) {
    for (interval_us, rate_hz) in [
        (100_000.0, 10.0),
        (20_000.0, 50.0),
        (333_333.0, 3.0),
        (2_000_000.0, 0.5),
    ] {
        let mut bench = Bench::running(DIVIDER_CODE);
        let request = command_long_2(SET_MESSAGE_INTERVAL, BATTERY_STATUS as f32, interval_us);
        assert_eq!(bench.result_of(&request), ACCEPTED);
        let expected = [(BATTERY_STATUS, rate_hz), (SYS_STATUS, 2.0), (HEARTBEAT, 1.0)];
        assert_rates(&mut bench, length_us, &expected);
    }
}

/// Sets several rates of both streams.
pub fn by_parameter(length_us: u64) {
    for rate_hz in [1.0, 2.0, 10.0, 50.0, 0.0] {
        let mut bench = Bench::running(DIVIDER_CODE);
        bench.set("SR0_EXTRA1", rate_hz as f32);
        bench.run_for(SAVED_US);
        let expected = [(SYS_STATUS, rate_hz), (BATTERY_STATUS, rate_hz), (HEARTBEAT, 1.0)];
        assert_rates(&mut bench, length_us, &expected);
    }
}
