//! Tests of the scheduler: that runs repeat exactly, and end when they should.

use super::adc::AdcInput;
use super::bench::*;
use super::thumb::{BX_LR, HANG, MAIN, STACK_TOP, WFI, adds, back, board, idle_board, load, pop, push};

#[test]
fn cutting_a_run_into_pieces_changes_nothing() {
    // Timer interrupts, UART traffic in both directions and paced conversions, all at once.
    let run = |pieces: &[u64]| {
        let mut board = counting_board();
        start_uart0(&mut board);
        select_function(&mut board, 0, FUNCTION_UART);
        select_function(&mut board, 1, FUNCTION_UART);
        board.adc_input(0, AdcInput::Volts(1.0));
        board.adc_noise(0.01);
        board.write_register(0x4004_c010, 4799 << 8);
        board.write_register(0x4004_c000, 1 | 1 << 3);
        (0..32).for_each(|byte| board.write_register(UART0, byte));
        board.uart_send(0, 100, b"0123456789");
        pieces.iter().for_each(|&micros| board.run_for(micros));
        let received: Vec<u32> = (0..10).map(|_| board.read_register(UART0)).collect();
        (
            board.uart(0).take_sent(),
            received,
            board.take_adc_record(),
            board.instructions(),
        )
    };
    let whole = run(&[3000]);
    assert_eq!(whole.0.len(), 32);
    assert_eq!(whole.2.len(), 30);
    assert!(whole == run(&[1, 2, 997, 1000, 500, 499, 1]));
    assert!(whole == run(&[1; 3000]));
}

#[test]
fn run_until_stops_when_the_condition_holds_or_the_time_is_up() {
    let mut board = counting_board();
    assert!(board.run_until(1000, |board| board.register(4) > 1000));
    assert!(board.time_us() < 200, "{}", board.time_us());
    let before = board.time_us();
    assert!(!board.run_until(50, |_| false));
    assert!((board.time_us() - before).abs_diff(50) <= 1);
}

#[test]
fn a_branch_to_itself_costs_time_and_no_instructions() {
    let mut board = board(&[HANG], &[(16 + 26, &[adds(7, 1), BX_LR])]);
    board.set_register(7, 0);
    board.run_for(1_000_000);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!(board.register(7), 1, "interrupts are taken");
    assert!(board.instructions() < 100, "{}", board.instructions());
    assert!(board.awake_cycles() >= 125_000_000, "{}", board.awake_cycles());
}

#[test]
fn run_until_time_does_nothing_for_the_past() {
    let mut board = idle_board();
    board.run_until_time(500);
    board.run_until_time(100);
    assert_eq!(board.time_us(), 500);
    board.run_for(100);
    assert_eq!(board.time_us(), 600);
}

#[test]
fn the_deepest_stack_is_remembered_with_the_handlers_on_it() {
    let mut board = board(
        &[push(0), push(0), pop(0), WFI, back(1)],
        &[(16 + 26, &[push(0), pop(0), BX_LR])],
    );
    board.run_for(10);
    assert_eq!(board.lowest_stack_pointer(), STACK_TOP - 8);
    pend_line_26(&mut board);
    board.run_for(10);
    // One word of the main program, one that aligns the frame of eight words, one of the handler.
    assert_eq!(board.register(13), STACK_TOP - 4);
    assert_eq!(board.lowest_stack_pointer(), STACK_TOP - 4 - 4 - 32 - 4);
    board.press_run();
    board.run_for(1);
    assert_eq!(
        board.lowest_stack_pointer(),
        STACK_TOP - 44,
        "a reset does not undo it"
    );
}

/// The flash cache is looked up by the processor's fetches and loads, which wait for what it does not hold.
#[test]
fn cache_misses_are_counted_and_take_time() {
    // Loads from R5 and R6, and goes round in one line of flash.
    let mut board = board(&[load(0, 5), load(0, 6), back(2)], &[]);
    board.set_register(5, MAIN);
    board.set_register(6, MAIN + 0x100);
    board.run_for(28);
    assert_eq!(board.xip_misses(), 2);
    let rounds = |cycles: u64| cycles / (2 + 2 + 3) * 3;
    let executed = board.instructions();
    assert!(executed.abs_diff(rounds(28 * 125 - 2 * 56)) <= 3, "{executed}");
    board.run_for(10);
    assert!((board.instructions() - executed).abs_diff(rounds(10 * 125)) <= 3);
    board.write_register(0x1400_0004, 1);
    board.run_for(10);
    assert_eq!(board.xip_misses(), 4, "after a flush");
}
