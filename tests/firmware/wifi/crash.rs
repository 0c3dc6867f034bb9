//! Crashes during the radio's turn.

use super::ground::Ground;
use crate::rover::task_named;
use emulator::{Board, CpuState, LogLevel};
use workbench::bench::{RUNNING, SECOND};

const OFF: &str = "Wi-Fi: OffAfterCrash";

/// Lets the radio's task hang in its next turn, and the board restart.
fn crash(ground: &mut Ground) {
    let radio = task_named(&ground.bench, b"Wi-Fi\0\0\0");
    let is_its_turn = |board: &mut Board| {
        board.cpu_state() == CpuState::Running
            && board.active_exception() == 0
            && board.read_register(RUNNING) == radio
    };
    assert!(ground.bench.run_until(2 * SECOND, is_its_turn));
    ground.bench.reset_by(2 * SECOND, |bench| bench.hang_program());
    ground.run_for(4 * SECOND);
}

fn is_up(ground: &mut Ground) -> bool {
    ground.bench.wifi().access_point().is_some()
}

#[test]
fn a_hang_during_the_radios_turn_leaves_wifi_off_the_second_time_in_a_row() {
    let mut ground = Ground::up();
    crash(&mut ground);
    let hung = ground
        .bench
        .logged(LogLevel::Warn, "Crash: hung or locked up in Wi-Fi");
    assert_eq!(hung.len(), 1, "{:?}", ground.bench.log_lines());
    assert!(is_up(&mut ground));
    assert!(ground.bench.logged(LogLevel::Info, OFF).is_empty());

    crash(&mut ground);
    assert!(!is_up(&mut ground));
    assert_eq!(ground.bench.logged(LogLevel::Info, OFF).len(), 1);
}
