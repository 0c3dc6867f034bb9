//! Tests of the PWM against the datasheet's figures, and of what is seen of it at the pins.

use super::super::bench::*;
use super::super::board::Board;
use super::super::register::RegisterWrite;
use super::super::thumb::idle_board;
use super::slice::{CC, CSR, CTR, DIV, TOP};
use super::{PwmOutput, Slice};

const PWM: u32 = 0x4005_0000;
const PWM_RESET: u32 = 1 << 14;
const ENABLE: u32 = 1;
const EN: u32 = 0xa0;
const ONE: u32 = 16;
const SET_ALIAS: u32 = 0x2000;
const CLEAR_ALIAS: u32 = 0x3000;

fn register(slice: u32, offset: u32) -> u32 {
    PWM + 0x14 * slice + offset
}

/// A board with slice 1 on GP18 (A) and GP19 (B), running at 500 Hz.
fn pwm_board(csr: u32, compare_a: u32, compare_b: u32) -> Board {
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    board.write_register(register(1, DIV), 4 * ONE);
    board.write_register(register(1, TOP), 62_499);
    board.write_register(register(1, CC), compare_b << 16 | compare_a);
    board.write_register(register(1, CSR), csr);
    select_function(&mut board, 18, FUNCTION_PWM);
    select_function(&mut board, 19, FUNCTION_PWM);
    board
}

fn levels(board: &Board) -> [Option<bool>; 2] {
    [board.pin_level(18), board.pin_level(19)]
}

fn duty(board: &Board, pin: usize) -> f64 {
    board.pwm_output(pin).expect("driven by PWM").duty
}

#[test]
fn registers_after_reset() {
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for slice in 0..8 {
        let read = [CSR, DIV, CTR, CC, TOP].map(|offset| board.read_register(register(slice, offset)));
        assert_eq!(read, [0, 0x10, 0, 0, 0xffff], "slice {slice}");
    }
    assert_eq!(board.read_register(PWM + EN), 0);
}

#[test]
fn a_pin_is_led_to_its_slice_and_channel() {
    // Of GPIO 0 to 29 (4.5.2).
    let slices = [
        0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6,
    ];
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for slice in 0..8 {
        board.write_register(register(slice, TOP), 99);
        board.write_register(register(slice, CC), (50 + slice) << 16 | slice);
    }
    board.write_register(PWM + EN, 0xff);
    for (pin, slice) in slices.into_iter().enumerate() {
        assert_eq!(board.pwm_output(pin), None);
        select_function(&mut board, pin as u32, FUNCTION_PWM);
        let compare = slice + if pin % 2 == 1 { 50 } else { 0 };
        let expected = PwmOutput {
            frequency_hz: 1_250_000.0,
            duty: f64::from(compare) / 100.0,
        };
        assert_eq!(board.pwm_output(pin), Some(expected), "GP{pin}");
    }
}

#[test]
fn the_lowest_frequency_is_about_7_5_hz() {
    // "Approximately 7.5 Hz from a 125 MHz system clock" (4.5.2.4).
    let mut board = pwm_board(ENABLE, 0, 0);
    board.write_register(register(2, DIV), 0xfff);
    board.write_register(register(2, CSR), ENABLE);
    select_function(&mut board, 20, FUNCTION_PWM);
    let hz = board.pwm_output(20).unwrap().frequency_hz;
    assert!((hz - 7.45).abs() < 0.01, "{hz}");
}

#[test]
fn a_level_is_high_while_the_counter_is_below_compare() {
    // A quarter of 2 ms.
    let mut board = pwm_board(ENABLE, 15_625, 46_875);
    assert_eq!(board.pwm_output(18).unwrap().frequency_hz, 500.0);
    for (at_us, expected) in [
        (1, [true, true]),
        (499, [true, true]),
        (501, [false, true]),
        (1499, [false, true]),
        (1501, [false, false]),
        (1999, [false, false]),
        (2001, [true, true]),
        (20_499, [true, true]),
        (20_501, [false, true]),
    ] {
        board.run_until_time(at_us);
        assert_eq!(levels(&board), expected.map(Some), "at {at_us} us");
    }
}

#[test]
fn no_pulse_at_compare_0_and_no_gap_above_top() {
    let mut board = pwm_board(ENABLE, 0, 62_500);
    for _ in 0..2001 {
        assert_eq!(levels(&board), [Some(false), Some(true)]);
        board.run_for(1);
    }
    assert_eq!((duty(&board, 18), duty(&board, 19)), (0.0, 1.0));
}

#[test]
fn a_fractional_divider_divides_on_average() {
    let mut board = pwm_board(ENABLE, 0, 0);
    // 2.5 cycles a count.
    board.write_register(register(0, DIV), 0x28);
    board.write_register(register(0, CSR), ENABLE);
    let before = board.read_register(register(0, CTR));
    board.run_for(1000);
    assert_eq!(board.read_register(register(0, CTR)) - before, 50_000);
}

#[test]
fn compare_and_top_come_into_force_when_the_counter_wraps() {
    let mut board = pwm_board(ENABLE, 15_625, 0);
    board.record_pin(18);
    board.run_until_time(1000);
    board.write_register(register(1, CC), 31_250);
    assert_eq!(board.read_register(register(1, CC)), 31_250, "what was written");
    board.run_until_time(1999);
    assert_eq!(duty(&board, 18), 0.25);
    board.run_until_time(2001);
    assert_eq!(duty(&board, 18), 0.5);
    board.write_register(register(1, TOP), 31_249);
    board.run_until_time(3999);
    assert_eq!(duty(&board, 18), 0.5);
    board.run_until_time(4001);
    let expected = PwmOutput {
        frequency_hz: 1000.0,
        duty: 1.0,
    };
    assert_eq!(board.pwm_output(18), Some(expected));

    let changes = board.take_pwm_changes(18);
    let times_and_duties: Vec<_> = changes
        .iter()
        .map(|(at, output)| (at / 125, output.expect("driven by PWM").duty))
        .collect();
    assert_eq!(times_and_duties, [(2000, 0.5), (4000, 1.0)]);
}

#[test]
fn a_run_without_a_look_ends_as_one_with_many() {
    let run = |pieces: &[u64]| {
        let mut board = pwm_board(ENABLE, 15_625, 0);
        board.write_register(register(1, CC), 31_250);
        board.write_register(register(1, TOP), 49_999);
        pieces.iter().for_each(|&micros| board.run_for(micros));
        (
            levels(&board),
            board.read_register(register(1, CTR)),
            board.pwm_output(18),
        )
    };
    assert_eq!(run(&[12_345]), run(&[5; 2469]));
}

#[test]
fn a_disabled_slice_holds_its_level_and_takes_what_is_written_at_once() {
    let mut board = pwm_board(ENABLE, 31_250, 31_250);
    board.run_until_time(500);
    board.write_register(PWM + EN + CLEAR_ALIAS, 1 << 1);
    assert_eq!(board.read_register(register(1, CSR)), 0);
    let counter = board.read_register(register(1, CTR));
    assert!(counter.abs_diff(15_625) < 2);
    board.run_for(10_000);
    assert_eq!(board.read_register(register(1, CTR)), counter);
    assert_eq!(levels(&board), [Some(true); 2], "held");
    let held = PwmOutput {
        frequency_hz: 0.0,
        duty: 1.0,
    };
    assert_eq!(board.pwm_output(18), Some(held));
    board.write_register(register(1, CC), 31_250 << 16);
    assert_eq!(levels(&board), [Some(false), Some(true)]);

    board.write_register(PWM + EN + SET_ALIAS, 1 << 1);
    board.run_for(499);
    assert_eq!(board.pin_level(19), Some(true), "goes on where it stood");
    board.run_for(2);
    assert_eq!(board.pin_level(19), Some(false));
}

#[test]
fn a_slice_held_in_reset_forgets_everything_and_its_outputs_are_low() {
    let mut board = pwm_board(ENABLE, 62_500, 62_500);
    assert_eq!(levels(&board), [Some(true); 2]);
    board.write_register(RESETS_SET, PWM_RESET);
    assert_eq!(levels(&board), [Some(false); 2]);
    board.write_register(RESETS_CLEAR, PWM_RESET);
    assert_eq!(board.read_register(register(1, TOP)), 0xffff);
    assert_eq!(levels(&board), [Some(false); 2]);
}

#[test]
fn a_chip_reset_leaves_the_pins_to_their_pulls() {
    let mut board = pwm_board(ENABLE, 62_500, 0);
    board.record_pin(18);
    board.press_run();
    assert_eq!(board.pin_level(18), None);
    assert_eq!(board.take_pwm_changes(18), [(0, None)]);
    assert_eq!(board.take_edges(18), [(0, false)]);
}

#[test]
fn a_pad_whose_output_is_disabled_is_not_driven() {
    let mut board = pwm_board(ENABLE, 62_500, 0);
    board.write_register(PADS_BANK0 + 4 + 4 * 18, 1 << 7);
    assert_eq!((board.pin_level(18), board.pwm_output(18)), (None, None));
}

#[test]
fn a_slice_that_runs_does_not_wake_the_emulator() {
    let mut board = pwm_board(ENABLE, 15_625, 0);
    board.write_register(register(1, TOP), 62_499);
    board.run_for(1000);
    assert_eq!(board.bus.next_event(), super::super::clock::NEVER);
    board.write_register(register(1, CC), 0);
    assert_ne!(board.bus.next_event(), super::super::clock::NEVER);
    board.run_for(3000);
    assert_eq!(board.bus.next_event(), super::super::clock::NEVER);
}

#[test]
fn what_is_not_modelled_is_refused() {
    for bit in 1..8 {
        let Err(reason) = std::panic::catch_unwind(|| pwm_board(1 << bit, 0, 0)) else {
            panic!("bit {bit}");
        };
        let reason = reason.downcast::<String>().expect("a text");
        assert!(
            reason.contains("only a free-running counter upwards is"),
            "{reason}"
        );
    }
}

/// Of slices that stand still, go on for ever, and take over another setting at the next wrap.
#[test]
fn the_next_change_of_a_level_is_known_ahead() {
    let settings = [
        (1, 99, 40),
        (1, 99, 0),
        (1, 99, 100),
        (1, 99, 200),
        (0, 99, 40),
        (1, 7, 3),
    ];
    for (csr, top, compare) in settings {
        for (div, count, later) in [
            (ONE, 0, None),
            (0x1c, 3, None),
            (ONE, 5, Some(77)),
            (ONE, 6, Some(0)),
        ] {
            let mut slice = Slice::after_reset(0);
            let settings = [
                (DIV, div),
                (TOP, top),
                (CC, compare << 16),
                (CTR, count),
                (CSR, csr),
            ];
            for (register, value) in settings.into_iter().chain(later.map(|level| (CC, level << 16))) {
                slice.write(register, RegisterWrite::plain(value));
            }
            let level = |now| slice.at(now).level(1);
            let mut change = slice.next_change(1);
            for now in 1..1_000 {
                let seen = slice.at(now);
                assert!(now <= change, "{csr} {top} {compare} {div} {later:?}");
                assert!(
                    now == change || level(now) == level(now - 1),
                    "unannounced at {now}"
                );
                if now == change {
                    change = seen.next_change(1);
                }
            }
        }
    }
}
