//! A link that is far too slow for what is asked of it.

use emulator::LogLevel;
use support::frames::{
    BATTERY_STATUS, HEARTBEAT, PARAM_VALUE, ParamValue, STATUSTEXT, SYS_STATUS, SysStatus,
    assert_no_sequence_gap, of_message,
};
use support::requests::{param_set, reboot};
use workbench::bench::{Bench, MILLISECOND, SECOND};

/// At 9600 baud and with `SR0_EXTRA1` at 50 Hz: ten times as much as the line carries is asked for.
fn overloaded() -> Bench {
    let mut bench = Bench::power_up(2482);
    bench.run_for(SECOND);
    bench.ask(&param_set("SERIAL0_BAUD", 9.0));
    bench.ask(&param_set("SR0_EXTRA1", 50.0));
    bench.ask(&reboot());
    assert!(bench.run_until(4 * SECOND, |board| !board.resets().is_empty()));
    bench
}

#[test]
// Requirement: AP-25
fn heartbeat_keeps_its_rate_and_every_stream_its_share() {
    let mut bench = overloaded();
    let from_us = bench.time_us();
    bench.run_for(120 * SECOND);
    let frames = bench.frames_since(from_us);
    assert_no_sequence_gap(&frames);

    let heartbeats = of_message(&frames, HEARTBEAT);
    assert!(
        heartbeats.len().abs_diff(120) <= 1,
        "{} heartbeats",
        heartbeats.len()
    );
    for pair in heartbeats.windows(2) {
        let interval_us = pair[1].at_us - pair[0].at_us;
        assert!(
            interval_us.abs_diff(SECOND) <= 250 * MILLISECOND,
            "{interval_us} us between heartbeats"
        );
    }

    let shares = [SYS_STATUS, BATTERY_STATUS].map(|message| of_message(&frames, message).len());
    println!(
        "in 120 s at 9600 baud: {} heartbeats, {shares:?} of SYS_STATUS and BATTERY_STATUS",
        heartbeats.len()
    );
    assert!(
        shares[0] > 900 && shares[0].abs_diff(shares[1]) * 5 <= shares[0],
        "{shares:?}"
    );
    let sys_status = of_message(&frames, SYS_STATUS);
    assert!(
        SysStatus(sys_status[sys_status.len() - 1]).dropped() > 8000,
        "drops are counted"
    );

    let announced: Vec<_> = of_message(&frames, STATUSTEXT)
        .iter()
        .map(|frame| frame.text(1, 50))
        .filter(|text| text.starts_with("Link"))
        .collect();
    assert_eq!(
        announced,
        ["Link too slow for its rates: telemetry reduced"],
        "said once"
    );
    assert!(!bench.logged(LogLevel::Warn, "link too slow").is_empty());
    assert_eq!(bench.resets().len(), 1);
}

#[test]
fn a_parameter_is_answered_within_a_second() {
    let mut bench = overloaded();
    bench.run_for(5 * SECOND);
    let mut slowest_us = 0;
    for number in 1..=20 {
        let asked_us = bench.time_us();
        let value = 4.0 + number as f32 * 0.01;
        bench.uart_send(0, asked_us, &param_set("BATT_VOLT_MULT", value));
        bench.run_for(SECOND);
        let frames = bench.frames();
        let answers = of_message(&frames, PARAM_VALUE);
        let answer = answers
            .iter()
            .find(|frame| frame.at_us > asked_us && ParamValue(frame).value() == value);
        let answered_us = answer
            .unwrap_or_else(|| panic!("request {number} was not answered in time"))
            .at_us;
        slowest_us = slowest_us.max(answered_us - asked_us);
        bench.run_for(37 * MILLISECOND);
    }
    println!(
        "slowest of 20 answers at 9600 baud: {:.0} ms",
        slowest_us as f64 / 1000.0
    );
}
