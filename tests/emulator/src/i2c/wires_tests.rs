//! Tests of the bus at the pins: recovery by hand, as the processor does it through SIO.

use super::super::bench::*;
use super::super::board::Board;
use super::super::pins::I2cPins;
use super::super::thumb::{HANG, board, load, store};
use super::tests::Probe;

const SDA: u32 = 14;
const SCL: u32 = 15;
const FUNCTION_I2C: u32 = 3;
const SIO_GPIO_IN: u32 = 0xd000_0004;
const SIO_GPIO_OE_XOR: u32 = 0xd000_002c;

/// A board whose program moves SCL this many times, then reads the pins into R3.
fn moving_board(moves: usize) -> Board {
    let mut program = vec![store(0, 1); moves];
    program.extend([load(3, 2), HANG]);
    let mut board = board(&program, &[]);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    set_registers(
        &mut board,
        [(0, 1 << SCL), (1, SIO_GPIO_OE_XOR), (2, SIO_GPIO_IN)],
    );
    select_function(&mut board, SDA, FUNCTION_SIO);
    select_function(&mut board, SCL, FUNCTION_SIO);
    board.i2c(1).attach(0x40, Box::new(Probe::default()));
    board
}

fn pins_read(board: &mut Board) -> (bool, bool) {
    board.run_for(10);
    let levels = board.register(3);
    (levels >> SCL & 1 != 0, levels >> SDA & 1 != 0)
}

#[test]
fn lines_that_no_device_pulls_are_high() {
    assert_eq!(pins_read(&mut moving_board(0)), (true, true));
    assert_eq!(pins_read(&mut moving_board(1)), (false, true));
}

#[test]
fn a_stuck_device_lets_go_of_sda_after_enough_clocks_by_hand() {
    for (clocks, is_free) in [(8, false), (9, true)] {
        let mut board = moving_board(2 * clocks);
        board.i2c(1).hold_sda(9);
        assert_eq!(pins_read(&mut board), (true, is_free), "{clocks} clocks");
    }
}

#[test]
fn scl_that_is_held_does_not_rise_by_hand() {
    let mut board = moving_board(18);
    board.i2c(1).hold_sda(9);
    board.i2c(1).hold_scl();
    assert_eq!(pins_read(&mut board), (false, false));
}

#[test]
fn the_block_reaches_its_bus_only_through_the_right_pins() {
    let mut board = moving_board(0);
    for (offset, value) in [(0x6c, 0), (0x04, 0x40), (0x6c, 1), (0x10, 0x211)] {
        board.write_register(I2C1 + offset, value);
    }
    board.run_for(1000);
    let sent = board.i2c(1).take_transactions();
    assert!(sent.is_empty(), "the pins are SIO's");
    board.wire_i2c(1, I2cPins { sda: 2, scl: 3 });
    for pin in [2, 3] {
        select_function(&mut board, pin, FUNCTION_I2C);
    }
    board.run_for(1000);
    assert_eq!(board.i2c(1).take_transactions()[0].written, [0x11]);
}

#[test]
#[should_panic(expected = "GPIO4 is not an SDA pin of I2C1")]
fn a_bus_at_pins_the_block_cannot_use_is_refused() {
    moving_board(0).wire_i2c(1, I2cPins { sda: 4, scl: 5 });
}
