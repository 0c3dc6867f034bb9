//! A link that is far too slow for what is asked of it.

use support::frames::{
    BATTERY_STATUS, HEARTBEAT, PARAM_VALUE, SYS_STATUS, SysStatus, assert_no_sequence_gap, of_message,
};
use support::requests::{VEHICLE, param_request_list, param_set, reboot};
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle};

/// At 9600 baud and with `SR0_EXTRA1` at 50 Hz: ten times as much as the line carries is asked for.
fn overloaded() -> Bench {
    let mut bench = Bench::running(2482);
    bench.ask(&param_set("SERIAL0_BAUD", 9.0));
    bench.ask(&param_set("SR0_EXTRA1", 50.0));
    bench.reset_by(4 * SECOND, |bench| drop(bench.ask(&reboot())));
    bench
}

#[test]
// Requirement: AP-25
fn heartbeat_keeps_its_rate() {
    let mut bench = overloaded();
    let from_us = bench.time_us();
    bench.run_for(15 * SECOND);
    let frames = bench.frames_since(from_us);
    assert_no_sequence_gap(&frames);
    assert!(of_message(&frames, HEARTBEAT).len().abs_diff(15) <= 1);
    let sys_status = of_message(&frames, SYS_STATUS);
    assert!(SysStatus(sys_status[sys_status.len() - 1]).dropped() > 0);
    assert_eq!(bench.resets().len(), 1);
}

#[test]
fn a_list_leaves_heartbeat_and_telemetry_flowing_and_takes_its_share() {
    let mut bench = Bench::running(2482);
    bench.set("SERIAL0_BAUD", 9.0);
    bench.reboot();
    let asked_us = bench.time_us();
    for _ in 0..10 {
        bench.ask(&param_request_list(VEHICLE));
        bench.run_for(SECOND - 200 * MILLISECOND);
    }
    let frames = bench.frames_since(asked_us);
    let bytes: usize = of_message(&frames, PARAM_VALUE)
        .iter()
        .map(|frame| frame.payload_len() + 12)
        .sum();
    // 960 bytes a second; one parameter more at the start of each list.
    assert!(
        bytes <= 10 * (288 + 37),
        "{bytes} bytes of parameters in ten seconds"
    );
    assert!(bytes > 10 * 200, "{bytes} bytes of parameters in ten seconds");
    for (message, per_second) in [(HEARTBEAT, 1), (SYS_STATUS, 2), (BATTERY_STATUS, 2)] {
        assert!(
            of_message(&frames, message).len().abs_diff(10 * per_second) <= 1,
            "message {message}"
        );
    }
}
