//! A board on which tests of the flash call the boot ROM as a driver does: from RAM, with
//! interrupts off.

pub use super::super::bench::RAM;
use super::super::board::Board;
use super::super::boot_rom::address_of;
use super::super::thumb::*;

/// The calls, in RAM.
const DRIVER: u32 = RAM + 0x1000;
/// What a program of a page takes its data from.
pub const DATA: u32 = RAM + 0x2000;
/// Far from the test's programs in flash, on a boundary of 64 KB.
pub const OFFSET: u32 = 0x10_0000;
pub const SECTOR: u32 = 4096;

/// The arguments of an erase by sectors, as embassy-rp gives them.
pub const fn erase_arguments(offset: u32, length: u32) -> [u32; 4] {
    [offset, length, 1 << 31, 0]
}

/// Line 26 counts in R7; the program stays where it starts.
pub fn flash_board() -> Board {
    let mut board = board(&[HANG], &[(16 + 26, &[adds(7, 1), BX_LR])]);
    board.set_register(7, 0);
    board
}

/// Begin to run code in RAM. In R4 to R6 and R8 it finds `flash_exit_xip`, the function,
/// `flash_flush_cache` and `flash_enter_cmd_xip`, in R0 to R3 the function's arguments.
pub fn start_code(board: &mut Board, code: &[u16], function: &[u8; 2], arguments: [u32; 4]) {
    let bytes: Vec<u8> = code.iter().flat_map(|halfword| halfword.to_le_bytes()).collect();
    board.write_memory(DRIVER, &bytes);
    let address = |code| address_of(code).expect("a function of the ROM");
    for (register, code) in [(4, b"EX"), (5, function), (6, b"FC"), (8, b"CX")] {
        board.set_register(register, address(code));
    }
    for (register, argument) in arguments.into_iter().enumerate() {
        board.set_register(register, argument);
    }
    board.set_register(15, DRIVER);
}

/// Begin a whole call, as a driver makes it.
pub fn start(board: &mut Board, function: &[u8; 2], arguments: [u32; 4]) {
    let driver = [CPSID_I, call(4), call(5), call(6), call(8), CPSIE_I, HANG];
    start_code(board, &driver, function, arguments);
}

/// Whether the call has returned, with interrupts on again.
pub fn is_done(board: &Board) -> bool {
    board.pc() == DRIVER + 12
}

pub fn start_erase(board: &mut Board, offset: u32, length: u32) {
    start(board, b"RE", erase_arguments(offset, length));
}

pub fn start_program(board: &mut Board, offset: u32, data: &[u8]) {
    board.write_memory(DATA, data);
    start(board, b"RP", [offset, DATA, data.len() as u32, 0]);
}

/// Let the call return; how many microseconds it took.
pub fn finish(board: &mut Board) -> u64 {
    let start = board.time_us();
    assert!(board.run_until(10_000_000, |board| is_done(board)), "returns");
    board.time_us() - start
}

pub fn erase(board: &mut Board, offset: u32, length: u32) -> u64 {
    start_erase(board, offset, length);
    finish(board)
}

pub fn program(board: &mut Board, offset: u32, data: &[u8]) -> u64 {
    start_program(board, offset, data);
    finish(board)
}
