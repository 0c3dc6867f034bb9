//! Tests of the stand-in boot ROM, called as a firmware calls it.

use super::bench::RAM;
use super::boot_rom::UNDEFINED_INSTRUCTION;
use super::thumb::*;

/// Where the ROM has the addresses of its tables (2.8.3.1).
const FUNCTIONS: u32 = 0x14;
const DATA: u32 = 0x16;

/// A board whose program calls what is in R5.
fn caller() -> super::Board {
    board(&[call(5), NOP, HANG], &[])
}

fn call_address(board: &mut super::Board, function: u32, arguments: &[u32]) -> u32 {
    for (number, argument) in arguments.iter().enumerate() {
        board.set_register(number, *argument);
    }
    board.set_register(5, function);
    board.set_register(15, MAIN);
    board.run_for(5);
    assert_eq!(board.pc(), MAIN + 4, "returned");
    board.register(0)
}

/// Look something up in a table of the ROM by its lookup routine.
fn look_up(board: &mut super::Board, table: u32, code: &[u8; 2]) -> u32 {
    let halfword = |board: &super::Board, address: u32| board.read_word(address) & 0xffff;
    let (table, lookup) = (halfword(board, table), halfword(board, 0x18));
    call_address(board, lookup, &[table, u32::from(u16::from_le_bytes(*code))])
}

/// Look a function up and call it; returns R0.
fn call_function(board: &mut super::Board, code: &[u8; 2], arguments: [u32; 3]) -> u32 {
    let function = look_up(board, FUNCTIONS, code);
    call_address(board, function, &arguments)
}

#[test]
fn memory_is_copied() {
    let mut board = caller();
    board.write_memory(RAM, b"....");
    assert_eq!(call_function(&mut board, b"MC", [RAM, 0x10, 3]), RAM);
    assert_eq!(
        board.read_memory(RAM, 4),
        b"Mu\x01.",
        "the ROM's own magic number"
    );
}

/// The table has a word for each routine: fadd, fsub, fmul, fdiv (2.8.3.2).
#[test]
fn singles_are_calculated_for_as_long_as_the_rom_takes() {
    for (number, expected, cycles) in [(0, 8.0f32, 71), (1, 4.0, 74), (2, 12.0, 69), (3, 3.0, 71)] {
        let mut board = caller();
        let table = look_up(&mut board, DATA, b"SF");
        let routine = board.read_word(table + 4 * number);
        let operands = [6.0f32, 2.0].map(f32::to_bits);
        let instructions = board.instructions();
        let result = call_address(&mut board, routine, &operands);
        assert_eq!(f32::from_bits(result), expected, "routine {number}");
        // The call and the return take some, and the loop at the end goes on for 5 µs.
        let elsewhere = board.instructions() - instructions - cycles;
        assert!((2..5 * 125 / 2).contains(&elsewhere), "{elsewhere}");
    }
}

#[test]
#[should_panic(expected = "wait_for_vector ('WV')")]
fn a_function_that_is_not_modelled_fails_by_name() {
    call_function(&mut caller(), b"WV", [0; 3]);
}

#[test]
#[should_panic(expected = "'XY'")]
fn a_function_that_does_not_exist_fails_at_the_lookup() {
    call_function(&mut caller(), b"XY", [0; 3]);
}

#[test]
fn what_is_not_a_function_is_undefined() {
    let mut board = board(&[branch_to(0)], &[]);
    board.set_register(0, UNDEFINED_INSTRUCTION | 1);
    board.run_for(5);
    assert_eq!(board.active_exception(), 3);
}
