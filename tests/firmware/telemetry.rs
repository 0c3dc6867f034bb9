//! What a ground station at the telemetry port receives.

use emulator::AdcInput;
use support::frames::{SYS_STATUS, SysStatus, of_message};
use workbench::bench::{Bench, MINUTE, PACK, SECOND};
use workbench::runs::exact_rates;

#[test]
// Requirement: FR-2
fn a_minute_at_exact_rates_without_drift() {
    exact_rates::run(MINUTE);
}

#[test]
fn the_telemetry_port_runs_at_115200_baud_8n1() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(SECOND);
    let sent = bench.uart(0).take_sent();
    // A start bit, eight data bits, a stop bit; the chip's divider can be off by a fraction of a percent.
    let byte_us = 10.0 / 115_200.0 * 1e6;
    for byte in &sent {
        let length_us = (byte.end - byte.start) as f64 / 125.0;
        let error = length_us / byte_us - 1.0;
        assert!(error.abs() < 0.005, "a byte of {length_us} us");
    }
    // A message leaves in one piece: 21 bytes of HEARTBEAT back to back.
    let heartbeat_us = (sent[20].end - sent[0].start) as f64 / 125.0;
    let error = heartbeat_us / (21.0 * byte_us) - 1.0;
    assert!(error.abs() < 0.005, "HEARTBEAT took {heartbeat_us} us");
}

#[test]
fn two_runs_give_identical_bytes_at_identical_times() {
    let run = |step_us: u64| {
        let mut bench = Bench::power_up(2482);
        bench.adc_input(PACK, AdcInput::Volts(2.1));
        bench.adc_noise(0.002);
        while bench.time_us() < 5 * SECOND {
            bench.run_for(step_us);
        }
        bench.sent().to_vec()
    };
    let first = run(SECOND / 10);
    assert!(first.len() > 700);
    assert!(
        run(5 * SECOND) == first,
        "the length of the emulator's steps shows"
    );
}

#[test]
fn the_load_is_the_share_of_time_the_processor_is_awake() {
    let mut bench = Bench::power_up(2482);
    bench.run_until_time(5 * SECOND);
    let awake_before = bench.awake_cycles();
    bench.run_for(10 * SECOND);
    let awake_permille = (bench.awake_cycles() - awake_before) as f64 / (10.0 * 125e6) * 1000.0;
    let frames = bench.frames();
    let sys_status = of_message(&frames, SYS_STATUS);
    let load_permille = f64::from(SysStatus(sys_status[sys_status.len() - 1]).load_permille());
    println!("load {load_permille} permille reported, {awake_permille:.2} permille awake");
    // Interrupts that end without waking a task count as idle, and the load is a whole number.
    assert!(load_permille <= awake_permille + 1.0);
    assert!(load_permille >= awake_permille / 2.0 - 1.0);
    assert!(load_permille < 30.0);
}
