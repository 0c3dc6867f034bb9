//! Hand-assembled Thumb programs for tests of the processor (encodings: ARMv6-M, A6.7).

use super::board::Board;
use super::firmware::Firmware;
use super::memory::{FLASH_BASE, FLASH_SIZE};

pub const NOP: u16 = 0xbf00;
pub const WFE: u16 = 0xbf20;
pub const WFI: u16 = 0xbf30;
pub const SEV: u16 = 0xbf40;
/// Branch to itself.
pub const HANG: u16 = 0xe7fe;
pub const CPSID_I: u16 = 0xb672;
pub const CPSIE_I: u16 = 0xb662;
pub const BX_LR: u16 = 0x4770;
pub const UDF: u16 = 0xde00;

/// `movs rd, #value`
pub const fn movs(rd: u16, value: u16) -> u16 {
    0x2000 | rd << 8 | value
}

/// `adds rd, #value`
pub const fn adds(rd: u16, value: u16) -> u16 {
    0x3000 | rd << 8 | value
}

/// `str rt, [rn]`
pub const fn store(rt: u16, rn: u16) -> u16 {
    0x6000 | rn << 3 | rt
}

/// `strb rt, [rn]`
pub const fn store_byte(rt: u16, rn: u16) -> u16 {
    0x7000 | rn << 3 | rt
}

/// `ldr rt, [rn]`
pub const fn load(rt: u16, rn: u16) -> u16 {
    0x6800 | rn << 3 | rt
}

/// `push {r<n>}`
pub const fn push(rt: u16) -> u16 {
    0xb400 | 1 << rt
}

/// `pop {r<n>}`
pub const fn pop(rt: u16) -> u16 {
    0xbc00 | 1 << rt
}

/// `bx rm`
pub const fn branch_to(rm: u16) -> u16 {
    0x4700 | rm << 3
}

/// `blx rm`
pub const fn call(rm: u16) -> u16 {
    0x4780 | rm << 3
}

/// `b` back over the last `instructions`, this one not counted.
pub const fn back(instructions: u16) -> u16 {
    0xe000 | (0x7fe - instructions) & 0x7ff
}

/// Where the main program starts, and where the handler of an exception does.
pub const MAIN: u32 = FLASH_BASE + 0x1000;
pub const fn handler(exception: u32) -> u32 {
    FLASH_BASE + 0x2000 + 0x100 * exception
}

pub const STACK_TOP: u32 = 0x2004_0000;
const VECTOR_TABLE: usize = 0x100;
const VECTORS: u32 = 48;

/// A board whose flash holds a main program and handlers, given by exception number. An exception
/// without a handler ends in an endless loop at its [`handler`] address.
pub fn board(main: &[u16], handlers: &[(u32, &[u16])]) -> Board {
    let mut flash = vec![0xff; FLASH_SIZE];
    put_word(&mut flash, VECTOR_TABLE, STACK_TOP);
    put_word(&mut flash, VECTOR_TABLE + 4, MAIN | 1);
    put_code(&mut flash, MAIN, main);
    for exception in 2..VECTORS {
        put_word(
            &mut flash,
            VECTOR_TABLE + 4 * exception as usize,
            handler(exception) | 1,
        );
        put_code(&mut flash, handler(exception), &[HANG]);
    }
    for &(exception, code) in handlers {
        put_code(&mut flash, handler(exception), code);
    }
    Board::power_up(&Firmware::from_flash(flash), 1)
}

/// A board that does nothing but count time.
pub fn idle_board() -> Board {
    board(&[WFI, back(1)], &[])
}

fn put_word(flash: &mut [u8], offset: usize, word: u32) {
    flash[offset..offset + 4].copy_from_slice(&word.to_le_bytes());
}

fn put_code(flash: &mut [u8], address: u32, code: &[u16]) {
    for (index, halfword) in code.iter().enumerate() {
        let offset = (address - FLASH_BASE) as usize + 2 * index;
        flash[offset..offset + 2].copy_from_slice(&halfword.to_le_bytes());
    }
}
