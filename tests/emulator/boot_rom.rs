//! A stand-in for the boot ROM (datasheet 2.8): its lookup tables, and traps for its functions,
//! which the host carries out.
//!
//! When the processor arrives at a function's address, the host does the work and returns to the
//! caller, as the `bx lr` at that address would.

use rp2040_emu::CortexM0Plus;
use rp2040_emu::core::CoreBus;

use super::bus::SystemBus;
use super::memory::ROM_SIZE;

/// Where the ROM says what it is and where its tables are (2.8.3.1).
const MAGIC: usize = 0x10;
const VERSION: u8 = 3;
const FUNCTION_TABLE_POINTER: usize = 0x14;
const DATA_TABLE_POINTER: usize = 0x16;
const LOOKUP_POINTER: usize = 0x18;

const FUNCTION_TABLE: u16 = 0x0100;
const DATA_TABLE: u16 = 0x0180;
/// Trap addresses: the lookup function, then [`FUNCTIONS`] in order.
const TRAPS: u32 = 0x0200;

/// Code for a test to derail the processor into.
pub const BRANCH_TO_SELF: u32 = 0x0300;
pub const UNDEFINED_INSTRUCTION: u32 = 0x0304;

const BX_LR: u16 = 0x4770;
const B_SELF: u16 = 0xe7fe;
const UDF: u16 = 0xde00;

/// A function of the boot ROM: its two-letter code and its name in the datasheet (2.8.3.1).
struct RomFunction {
    code: &'static [u8; 2],
    name: &'static str,
}

const FUNCTIONS: [RomFunction; 17] = [
    RomFunction {
        code: b"P3",
        name: "popcount32",
    },
    RomFunction {
        code: b"R3",
        name: "reverse32",
    },
    RomFunction {
        code: b"L3",
        name: "clz32",
    },
    RomFunction {
        code: b"T3",
        name: "ctz32",
    },
    RomFunction {
        code: b"MS",
        name: "memset",
    },
    RomFunction {
        code: b"S4",
        name: "memset4",
    },
    RomFunction {
        code: b"MC",
        name: "memcpy",
    },
    RomFunction {
        code: b"C4",
        name: "memcpy44",
    },
    RomFunction {
        code: b"IF",
        name: "connect_internal_flash",
    },
    RomFunction {
        code: b"EX",
        name: "flash_exit_xip",
    },
    RomFunction {
        code: b"RE",
        name: "flash_range_erase",
    },
    RomFunction {
        code: b"RP",
        name: "flash_range_program",
    },
    RomFunction {
        code: b"FC",
        name: "flash_flush_cache",
    },
    RomFunction {
        code: b"CX",
        name: "flash_enter_cmd_xip",
    },
    RomFunction {
        code: b"UB",
        name: "reset_to_usb_boot",
    },
    RomFunction {
        code: b"WV",
        name: "wait_for_vector",
    },
    RomFunction {
        code: b"DT",
        name: "debug_trampoline",
    },
];

/// The image of the ROM. What is neither table nor trap is an undefined instruction.
pub fn image() -> Vec<u8> {
    let mut rom: Vec<u8> = UDF.to_le_bytes().repeat(ROM_SIZE / 2);
    let mut put = |address: usize, value: u16| {
        rom[address..address + 2].copy_from_slice(&value.to_le_bytes());
    };
    put(MAGIC, u16::from_le_bytes(*b"Mu"));
    put(MAGIC + 2, u16::from_le_bytes([1, VERSION]));
    put(FUNCTION_TABLE_POINTER, FUNCTION_TABLE);
    put(DATA_TABLE_POINTER, DATA_TABLE);
    put(LOOKUP_POINTER, TRAPS as u16 | 1);
    put(usize::from(FUNCTION_TABLE), 0);
    put(usize::from(DATA_TABLE), 0);
    for trap in 0..=FUNCTIONS.len() {
        put(TRAPS as usize + 2 * trap, BX_LR);
    }
    put(BRANCH_TO_SELF as usize, B_SELF);
    put(UNDEFINED_INSTRUCTION as usize, UDF);
    rom
}

/// If the processor stands at a trap, do what the function does, leave its result in R0 and return
/// to the caller. Returns the cycles charged.
pub fn call(core: &mut CortexM0Plus, bus: &mut SystemBus) -> Option<u64> {
    let pc = core.regs.pc();
    let trap = pc
        .checked_sub(TRAPS)
        .filter(|offset| *offset < 2 * (1 + FUNCTIONS.len() as u32))?;
    let arguments = [core.reg(0), core.reg(1), core.reg(2)];
    let (result, cycles) = match trap / 2 {
        0 => (look_up(arguments[0], arguments[1]), LOOKUP_CYCLES),
        number => run(&FUNCTIONS[number as usize - 1], arguments, bus),
    };
    core.set_reg(0, result);
    core.set_reg(15, core.reg(14) & !1);
    Some(cycles)
}

/// Roughly what the ROM's loops take; nothing in a test may depend on it.
const LOOKUP_CYCLES: u64 = 50;
const BIT_FUNCTION_CYCLES: u64 = 20;

fn look_up(table: u32, code: u32) -> u32 {
    let letters = [code as u8, (code >> 8) as u8];
    let found = FUNCTIONS.iter().position(|function| *function.code == letters);
    match found {
        Some(number) if table == u32::from(FUNCTION_TABLE) => (TRAPS + 2 * (1 + number as u32)) | 1,
        _ => panic!(
            "the firmware looks up '{}' in the boot ROM's table at {table:#x}, which the emulator's \
             boot ROM does not have",
            String::from_utf8_lossy(&letters)
        ),
    }
}

fn run(function: &RomFunction, [a, b, c]: [u32; 3], bus: &mut SystemBus) -> (u32, u64) {
    match function.code {
        b"P3" => (a.count_ones(), BIT_FUNCTION_CYCLES),
        b"R3" => (a.reverse_bits(), BIT_FUNCTION_CYCLES),
        b"L3" => (a.leading_zeros(), BIT_FUNCTION_CYCLES),
        b"T3" => (a.trailing_zeros(), BIT_FUNCTION_CYCLES),
        b"MS" | b"S4" => {
            (0..c).for_each(|index| bus.write8(a.wrapping_add(index), b as u8));
            (a, u64::from(c).max(1))
        }
        b"MC" | b"C4" => {
            for index in 0..c {
                let byte = bus.read8(b.wrapping_add(index));
                bus.write8(a.wrapping_add(index), byte);
            }
            (a, u64::from(c).max(1))
        }
        _ => panic!(
            "the firmware called the boot ROM function {} ('{}'), which the emulator does not model",
            function.name,
            String::from_utf8_lossy(function.code)
        ),
    }
}
