//! What several tests of the board share: register addresses and set-up.

use super::board::Board;
use super::thumb::{BX_LR, adds, back, board};

pub const RAM: u32 = 0x2000_0000;
pub const RESETS: u32 = 0x4000_c000;
pub const RESETS_SET: u32 = 0x4000_e000;
pub const RESETS_CLEAR: u32 = 0x4000_f000;
pub const UART0_RESET: u32 = 1 << 22;
pub const ALL_BLOCKS: u32 = 0x01ff_ffff;
pub const PSM_WDSEL: u32 = 0x4001_0008;
pub const EVERYTHING_BUT_OSCILLATORS: u32 = 0x1_fffc;
pub const IO_BANK0: u32 = 0x4001_4000;
pub const PADS_BANK0: u32 = 0x4001_c000;
pub const FUNCTION_SPI: u32 = 1;
pub const FUNCTION_UART: u32 = 2;
pub const FUNCTION_PWM: u32 = 4;
pub const FUNCTION_SIO: u32 = 5;
pub const UART0: u32 = 0x4003_4000;
pub const UART1: u32 = 0x4003_8000;
pub const TIMER_RAWL: u32 = 0x4005_4028;
pub const WATCHDOG_CTRL: u32 = 0x4005_8000;
pub const WATCHDOG_LOAD: u32 = 0x4005_8004;
pub const WATCHDOG_REASON: u32 = 0x4005_8008;
pub const WATCHDOG_SCRATCH0: u32 = 0x4005_800c;
pub const WATCHDOG_TICK: u32 = 0x4005_802c;
pub const TICK_1_US: u32 = 1 << 9 | 12;
pub const CHIP_RESET: u32 = 0x4006_4008;
pub const HAD_POR: u32 = 1 << 8;
pub const HAD_RUN: u32 = 1 << 16;
pub const AIRCR: u32 = 0xe000_ed0c;
pub const I2C1: u32 = 0x4004_8000;
pub const SPI0: u32 = 0x4003_c000;
pub const SPI1: u32 = 0x4004_0000;

pub fn start_watchdog(board: &mut Board, micros: u32) {
    board.write_register(PSM_WDSEL, EVERYTHING_BUT_OSCILLATORS);
    board.write_register(WATCHDOG_TICK, TICK_1_US);
    board.write_register(WATCHDOG_LOAD, 2 * micros);
    board.write_register(WATCHDOG_CTRL, 1 << 30);
}

/// UART0 at 115200 baud, everything set up but the pins.
pub fn start_uart0(board: &mut Board) {
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    set_up_uart(board, UART0);
}

/// A UART at 115200 baud with FIFOs, both ways.
pub fn set_up_uart(board: &mut Board, uart: u32) {
    for (offset, value) in [(0x24, 67), (0x28, 52), (0x2c, 0x70), (0x30, 0x301)] {
        board.write_register(uart + offset, value);
    }
}

pub fn select_function(board: &mut Board, pin: u32, function: u32) {
    board.write_register(IO_BANK0 + 8 * pin + 4, function);
}

pub fn set_registers<const N: usize>(board: &mut Board, registers: [(usize, u32); N]) {
    for (number, value) in registers {
        board.set_register(number, value);
    }
}

pub fn ram(board: &Board) -> Vec<u8> {
    board.read_memory(RAM, 0x1000)
}

/// Counts interrupts of software line 26 in R7 and rounds of the main loop in R4.
pub fn counting_board() -> Board {
    let mut board = board(&[adds(4, 1), back(1)], &[(16 + 26, &[adds(7, 1), BX_LR])]);
    set_registers(&mut board, [(4, 0), (7, 0)]);
    board
}

pub fn pend_line_26(board: &mut Board) {
    board.bus.store_system_control(0xe000_e100, 1 << 26);
    board.bus.store_system_control(0xe000_e200, 1 << 26);
}
