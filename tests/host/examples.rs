//! The examples for a desk, run as their user runs them.

use std::env;
use std::process::Command;

use support::frames::{
    BATTERY_STATUS, BatteryStatus, HEARTBEAT, SYS_STATUS, SysStatus, assert_no_sequence_gap, frames,
};

/// The output of an example, which `cargo test` has built beside this program.
fn printed_by(name: &str) -> String {
    let program = env::current_exe().expect("the program's path is known");
    let folder = program
        .ancestors()
        .nth(2)
        .expect("it is target/PROFILE/deps/PROGRAM");
    let output = Command::new(folder.join("examples").join(name))
        .output()
        .unwrap_or_else(|error| panic!("{error}. Type: cargo build --example {name}"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout).expect("text")
}

/// The bytes in "3 bytes: [fd, 09, 00]".
fn bytes_of(line: &str) -> Vec<u8> {
    let (count, bytes) = line.split_once(" bytes: ").expect("a line of bytes");
    let bytes: Vec<u8> = bytes
        .trim_matches(['[', ']'])
        .split(", ")
        .map(|byte| u8::from_str_radix(byte, 16).expect("a byte"))
        .collect();
    assert_eq!(count, bytes.len().to_string());
    bytes
}

#[test]
fn builders_prints_frames_that_a_ground_station_understands() {
    let text = printed_by("builders");
    let lines = text.lines().filter(|line| line.contains(" bytes: "));
    let wire: Vec<(u64, u8)> = lines.flat_map(bytes_of).map(|byte| (0, byte)).collect();
    let frames = frames(&wire);
    assert_no_sequence_gap(&frames);
    let [heartbeat, sys_status, battery_status] = frames.as_slice() else {
        panic!("{frames:?}");
    };
    let ids = [heartbeat, sys_status, battery_status].map(|frame| frame.message_id);
    assert_eq!(ids, [HEARTBEAT, SYS_STATUS, BATTERY_STATUS]);
    assert_eq!(SysStatus(sys_status).voltage_mv(), 11_620);
    assert_eq!(BatteryStatus(battery_status).voltage_mv(0), 11_620);
    assert!(text.contains("voltage_battery: 11620,"), "{text}");
}
