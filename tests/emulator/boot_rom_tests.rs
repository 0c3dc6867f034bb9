//! Tests of the stand-in boot ROM, called as a firmware calls it.

use super::boot_rom::UNDEFINED_INSTRUCTION;
use super::thumb::*;

const RAM: u32 = 0x2000_0000;

/// Look a function up by the ROM's own table and lookup routine, and call it; returns R0.
fn call_function(
    code: &[u8; 2],
    arguments: [u32; 3],
    prepare: impl Fn(&mut super::Board),
) -> (u32, super::Board) {
    let mut board = board(&[call(5), NOP, HANG], &[]);
    prepare(&mut board);
    let halfword = |board: &super::Board, address| {
        u32::from_le_bytes(board.read_memory(address, 4).try_into().expect("4 bytes")) & 0xffff
    };
    let (table, lookup) = (halfword(&board, 0x14), halfword(&board, 0x18));
    board.set_register(0, table);
    board.set_register(1, u32::from(u16::from_le_bytes(*code)));
    board.set_register(5, lookup);
    board.run_for(5);
    let function = board.register(0);
    for (number, argument) in arguments.into_iter().enumerate() {
        board.set_register(number, argument);
    }
    board.set_register(5, function);
    board.set_register(15, MAIN);
    board.run_for(5);
    assert_eq!(board.pc(), MAIN + 4, "returned");
    (board.register(0), board)
}

#[test]
fn bit_functions() {
    let result = |code, value| call_function(code, [value, 0, 0], |_| {}).0;
    assert_eq!(result(b"P3", 0xf0f0_0001), 9);
    assert_eq!(result(b"R3", 0x8000_0001 << 1), 0x4000_0000);
    assert_eq!(result(b"L3", 0x0001_0000), 15);
    assert_eq!(result(b"L3", 0), 32);
    assert_eq!(result(b"T3", 0x0001_0000), 16);
}

#[test]
fn memory_functions() {
    let (result, board) = call_function(b"MC", [RAM, 0x10, 3], |board| board.write_memory(RAM, b"...."));
    assert_eq!(
        (result, board.read_memory(RAM, 4)),
        (RAM, b"Mu\x01.".to_vec()),
        "the ROM's own magic number"
    );
    let (result, board) = call_function(b"MS", [RAM, 0xaa, 2], |board| board.write_memory(RAM, b"...."));
    assert_eq!((result, board.read_memory(RAM, 4)), (RAM, b"\xaa\xaa..".to_vec()));
}

#[test]
#[should_panic(expected = "wait_for_vector ('WV')")]
fn a_function_that_is_not_modelled_fails_by_name() {
    call_function(b"WV", [0; 3], |_| {});
}

#[test]
#[should_panic(expected = "'XY'")]
fn a_function_that_does_not_exist_fails_at_the_lookup() {
    call_function(b"XY", [0; 3], |_| {});
}

#[test]
fn what_is_not_a_function_is_undefined() {
    let mut board = board(&[branch_to(0)], &[]);
    board.set_register(0, UNDEFINED_INSTRUCTION | 1);
    board.run_for(5);
    assert_eq!(board.active_exception(), 3);
}
