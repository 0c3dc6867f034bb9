//! Motors, lamps and buzzer of the firmware in `examples/motor_bench.rs`, as they are seen at the pins.

use std::sync::OnceLock;

use crate::lamps::{LAMPS, decode};
use crate::wheels::{duties, pins};
use emulator::{Board, Firmware};
use support::motor_poles::{LEFT, Motor, RIGHT, motors};
use workbench::bench::{CYCLES_PER_US, MILLISECOND, SECOND};
use workbench::elf::{Artifact, build};

pub const BUZZER: usize = 2;

const PWM_PERIOD_US: u64 = 2 * MILLISECOND;

fn firmware() -> &'static Firmware {
    static FIRMWARE: OnceLock<Firmware> = OnceLock::new();
    FIRMWARE.get_or_init(|| Firmware::load(build(Artifact::Example("motor_bench"))))
}

/// A board that has just begun a step of the firmware.
fn board_at(step: &str) -> Board {
    let mut board = Board::power_up(firmware(), 1);
    run_to(&mut board, step);
    board
}

fn run_to(board: &mut Board, step: &str) {
    let begun = |board: &mut Board| board.log_lines().iter().any(|line| line.text == step);
    let is_begun = board.run_until(SECOND, begun);
    assert!(is_begun, "no step {step:?}: {:?}", board.log_lines());
}

/// The share of time in which the poles of a motor are driven, at 500 Hz.
fn duties_at_500_hz(motor: Motor, board: &Board) -> (f64, f64) {
    for pin in [motor.positive, motor.negative] {
        let hz = board.pwm_output(pin).map(|output| output.frequency_hz);
        assert!(
            hz.is_some_and(|hz| (hz - 500.0).abs() <= 5.0),
            "GP{pin}: {hz:?} Hz"
        );
    }
    duties(motor, board)
}

/// Panics unless the motors of each side have these duties at their poles one period after a step began.
fn assert_driven(step: &str, left: (f64, f64), right: (f64, f64)) {
    let mut board = board_at(step);
    board.run_for(PWM_PERIOD_US);
    for (motors, expected) in [(LEFT, left), (RIGHT, right)] {
        for motor in motors {
            assert_eq!(duties_at_500_hz(motor, &board), expected, "{step}: {motor:?}");
        }
    }
}

#[test]
fn ahead_is_pulses_at_the_positive_pole_and_back_at_the_negative_one() {
    assert_driven("ahead 50 %", (0.5, 0.0), (0.5, 0.0));
    assert_driven("back 25 %", (0.0, 0.25), (0.0, 0.25));
    assert_driven("full spin", (1.0, 0.0), (0.0, 1.0));
    assert_driven("out of range", (1.0, 0.0), (0.0, 0.0));
}

#[test]
fn a_change_comes_into_force_within_a_period_and_for_both_poles_at_once() {
    let mut board = board_at("back 25 %");
    board.run_for(PWM_PERIOD_US);
    pins().for_each(|pin| board.record_pin(pin));
    run_to(&mut board, "full spin");
    // Its log line is written after the motors were set.
    let logged = board.time_cycles();
    board.run_for(PWM_PERIOD_US);
    for motor in motors() {
        let times: Vec<u64> = [motor.positive, motor.negative]
            .into_iter()
            .flat_map(|pin| board.take_pwm_changes(pin))
            .map(|(at, _)| at)
            .collect();
        assert!(!times.is_empty(), "{motor:?}");
        assert!(times.iter().all(|&at| at == times[0]), "{times:?}");
        assert!(times[0] <= logged + PWM_PERIOD_US * CYCLES_PER_US);
    }
}

#[test]
fn eight_lamps_are_sent_the_colour_when_it_changes() {
    let mut board = board_at("nothing yet");
    board.record_pin(LAMPS);
    run_to(&mut board, "coast");
    assert_eq!(board.take_edges(LAMPS), [], "nothing before the first colour");
    // Green, red and blue.
    for (step, bytes) in [
        ("red", [0, 16, 0]),
        ("green", [16, 0, 0]),
        ("blue", [0, 0, 16]),
        ("yellow", [16, 16, 0]),
        ("off", [0, 0, 0]),
    ] {
        run_to(&mut board, step);
        board.run_for(MILLISECOND);
        let edges = board.take_edges(LAMPS);
        assert_eq!(decode(&edges), bytes.repeat(8), "{step}");
        let (first, last) = (edges[0].0, edges[edges.len() - 1].0);
        println!("{step}: {} us", (last - first) / CYCLES_PER_US);
    }
    run_to(&mut board, "tone");
    assert!(board.take_edges(LAMPS).is_empty(), "the colour stays");
    run_to(&mut board, "green tone");
    board.run_for(MILLISECOND);
    let edges = board.take_edges(LAMPS);
    let green = [16, 0, 0].repeat(8);
    assert_eq!(decode(&edges), green, "between the buzzer's interrupts");
}

#[test]
fn the_buzzer_sounds_at_2_khz_and_is_silent_otherwise() {
    let mut board = board_at("nothing yet");
    board.record_pin(BUZZER);
    run_to(&mut board, "tone");
    assert!(board.take_edges(BUZZER).len() <= 1, "not before");
    run_to(&mut board, "silence");
    board.run_for(MILLISECOND);
    let edges = board.take_edges(BUZZER);
    assert_eq!(board.pin_level(BUZZER), Some(false));
    let rises: Vec<u64> = edges.iter().filter(|edge| edge.1).map(|edge| edge.0).collect();
    let periods = rises.len() as u64 - 1;
    let hz = (periods * CYCLES_PER_US * SECOND) as f64 / (rises[rises.len() - 1] - rises[0]) as f64;
    println!("{hz:.1} Hz over {periods} periods");
    assert!((hz - 2000.0).abs() <= 20.0, "{hz} Hz");
    assert!((79..=81).contains(&rises.len()), "40 ms");
    board.run_for(10 * MILLISECOND);
    assert!(board.take_edges(BUZZER).is_empty(), "silence");
}
