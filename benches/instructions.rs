//! Instructions that things take, counted on the emulated RP2040: the same number in every run.

#[path = "../tests/support/elf.rs"]
mod elf;
#[path = "../tests/emulator/mod.rs"]
mod emulator;

use elf::{Artifact, build};
use emulator::{Board, Firmware};

/// High while something is measured.
const MEASURING_PIN: usize = 22;
const MIXED_STREAM_BYTES: u64 = include_bytes!("data/mixed_stream.bin").len() as u64;
const PATIENCE_US: u64 = 1_000_000;

/// How often the firmware serialises each message.
const SERIALISATIONS: u64 = 1000;

/// How many readings of a pack it takes through a monitor.
const UPDATES: u64 = 1000;

/// What the MAVLink C library takes for the same (`_send_struct` and `mavlink_parse_char`, -O2).
const C_RECEIVE_PER_BYTE: f64 = 58.0;

/// The goal for receiving, as a share of the C library's.
const RECEIVE_GOAL: f64 = 0.6;

/// Instructions until the measuring pin has gone up and down again.
fn measure(board: &mut Board) -> u64 {
    let mut edge = |level| {
        assert!(
            board.run_until(PATIENCE_US, |board| board.pin_level(MEASURING_PIN) == Some(level)),
            "no more to measure"
        );
        board.instructions()
    };
    let start = edge(true);
    edge(false) - start
}

fn main() {
    let firmware = Firmware::load(build(Artifact::Example("instruction_counts")));
    let mut board = Board::power_up(&firmware, 1);
    let receive = measure(&mut board) as f64 / MIXED_STREAM_BYTES as f64;
    println!("receive, in 64-byte chunks      {receive:6.1} instructions per byte");
    println!(
        "  of the C library's {C_RECEIVE_PER_BYTE}          {:6.2} (goal {RECEIVE_GOAL})",
        receive / C_RECEIVE_PER_BYTE
    );
    for message in ["HEARTBEAT", "SYS_STATUS", "BATTERY_STATUS"] {
        println!(
            "serialise {message:21} {:6} instructions",
            measure(&mut board) / SERIALISATIONS
        );
    }
    println!(
        "serialise BATTERY_STATUS and sign  {:6} instructions",
        measure(&mut board) / SERIALISATIONS
    );
    for sensor in ["voltage", "voltage and current"] {
        println!(
            "battery update, {sensor:21} {:6} instructions",
            measure(&mut board) / UPDATES
        );
    }
    println!(
        "{}",
        board
            .log_lines()
            .iter()
            .map(|line| format!("  {}\n", line.text))
            .collect::<String>()
    );
}
