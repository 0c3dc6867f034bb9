//! Tests of the faults a test puts in.

use super::bench::*;
use super::cpu::CpuState;
use super::thumb::{CPSID_I, WFE, adds, back, board};

#[test]
fn a_hung_program_stays_where_it_is_while_interrupts_go_on() {
    let mut board = counting_board();
    board.run_for(10);
    board.hang_program();
    board.run_for(10);
    let rounds = board.register(4);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!((board.register(4), board.register(7)), (rounds, 1));
    assert_eq!(board.active_exception(), 0);
    board.press_run();
    board.run_for(100);
    assert_ne!(board.register(4), rounds, "a reset ends it");
}

#[test]
fn a_sleeping_program_can_be_hung_and_one_with_interrupts_off_is_left_alone() {
    let mut board = board(&[WFE, back(1)], &[]);
    board.run_for(10);
    assert_eq!(board.cpu_state(), CpuState::WaitingForEvent);
    board.hang_program();
    board.run_for(10);
    assert_eq!(board.cpu_state(), CpuState::Running);
    let mut board = super::thumb::board(&[CPSID_I, adds(4, 1), back(1)], &[]);
    board.run_for(10);
    board.hang_program();
    let before = board.register(4);
    board.run_for(10);
    assert_ne!(board.register(4), before);
}

#[test]
fn a_derailed_program_meets_an_undefined_instruction() {
    let mut board = counting_board();
    board.run_undefined_instruction();
    board.run_for(10);
    assert_eq!(board.active_exception(), 3);
}

#[test]
fn a_cut_interrupt_is_not_delivered_until_it_is_restored() {
    let mut board = counting_board();
    board.cut_interrupt(26);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!(board.register(7), 0);
    board.restore_interrupt(26);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!(board.register(7), 1);
}
