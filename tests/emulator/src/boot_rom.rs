//! A stand-in for the boot ROM (datasheet 2.8): its lookup tables, and traps for its functions,
//! which the host carries out.
//!
//! When the processor arrives at a function's address, the host does the work and returns to the
//! caller, as the `bx lr` at that address would. While a function waits for the flash chip the
//! processor stays at its address, so that interrupts can be taken there as in the ROM's own loop.

use rp2040_emu::CortexM0Plus;
use rp2040_emu::core::CoreBus;

use super::boot_loader::reset_to_usb_boot;
use super::bus::SystemBus;
use super::clock::Cycle;
use super::firmware::SECOND_STAGE_BYTES;
use super::flash::{Job, Step, transfer_cycles};
use super::memory::ROM_SIZE;
use super::rom_floats::FloatRoutine;
use super::ssi::Ssi;

/// Where the ROM says what it is and where its tables are (2.8.3.1).
const MAGIC: usize = 0x10;
const VERSION: u8 = 3;
const FUNCTION_TABLE_POINTER: usize = 0x14;
const DATA_TABLE_POINTER: usize = 0x16;
const LOOKUP_POINTER: usize = 0x18;

const FUNCTION_TABLE: u16 = 0x0100;
const DATA_TABLE: u16 = 0x0180;
/// The table of the routines for singles (2.8.3.2), which the data table has as "SF". After the routines that are modelled
/// it has undefined instructions.
const SOFT_FLOAT_TABLE: u16 = 0x0400;
const SOFT_FLOAT_TABLE_WORDS: u16 = 0x80 / 4;
/// Trap addresses of [`FloatRoutine::ALL`].
const FLOAT_TRAPS: u32 = 0x0320;
const FLOAT_TRAPS_END: u32 = FLOAT_TRAPS + 2 * FloatRoutine::ALL.len() as u32;
/// Trap addresses: the lookup function, then [`FUNCTIONS`] in order, then [`WAIT_FOR_FLASH`].
const TRAPS: u32 = 0x0200;
/// Where the boot ROM waits for a flash chip that was busy at a reset. It goes on at the address in
/// LR.
pub const WAIT_FOR_FLASH: u32 = TRAPS + 2 * (1 + FUNCTIONS.len() as u32);

/// Code for a test to derail the processor into.
pub const BRANCH_TO_SELF: u32 = 0x0300;
pub const UNDEFINED_INSTRUCTION: u32 = 0x0304;

/// The second stage in RAM, as the boot ROM has copied it.
pub const SECOND_STAGE: u32 = 0x2004_1f00;
/// The boot ROM's code that starts it, with LR = 0, as nothing has called it.
pub const START_SECOND_STAGE: u32 = 0x0310;
const START_SECOND_STAGE_CODE: [u16; 4] = [0x4801, 0x2100, 0x468e, 0x4700];

/// Where the boot ROM sleeps until the watchdog resets the chip, and in its USB boot loader.
pub const WAIT_FOR_RESET: u32 = 0x0308;
pub const USB_BOOT: u32 = 0x030c;

const BX_LR: u16 = 0x4770;
const B_SELF: u16 = 0xe7fe;
const UDF: u16 = 0xde00;
const WFI: u16 = 0xbf30;
const B_PREVIOUS: u16 = 0xe7fd;

/// A function of the boot ROM: its two-letter code and its name in the datasheet (2.8.3.1).
struct RomFunction {
    code: &'static [u8; 2],
    name: &'static str,
}

const fn function(code: &'static [u8; 2], name: &'static str) -> RomFunction {
    RomFunction { code, name }
}

const FUNCTIONS: [RomFunction; 17] = [
    function(b"P3", "popcount32"),
    function(b"R3", "reverse32"),
    function(b"L3", "clz32"),
    function(b"T3", "ctz32"),
    function(b"MS", "memset"),
    function(b"S4", "memset4"),
    function(b"MC", "memcpy"),
    function(b"C4", "memcpy44"),
    function(b"IF", "connect_internal_flash"),
    function(b"EX", "flash_exit_xip"),
    function(b"RE", "flash_range_erase"),
    function(b"RP", "flash_range_program"),
    function(b"FC", "flash_flush_cache"),
    function(b"CX", "flash_enter_cmd_xip"),
    function(b"UB", "reset_to_usb_boot"),
    function(b"WV", "wait_for_vector"),
    function(b"DT", "debug_trampoline"),
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
    for trap in (TRAPS..=WAIT_FOR_FLASH).step_by(2) {
        put(trap as usize, BX_LR);
    }
    for trap in (FLOAT_TRAPS..FLOAT_TRAPS_END).step_by(2) {
        put(trap as usize, BX_LR);
    }
    for number in 0..SOFT_FLOAT_TABLE_WORDS {
        let trap = FLOAT_TRAPS + 2 * u32::from(number);
        let is_modelled = usize::from(number) < FloatRoutine::ALL.len();
        let address = if is_modelled { trap } else { UNDEFINED_INSTRUCTION };
        put(usize::from(SOFT_FLOAT_TABLE + 4 * number), address as u16 | 1);
        put(usize::from(SOFT_FLOAT_TABLE + 4 * number + 2), 0);
    }
    put(BRANCH_TO_SELF as usize, B_SELF);
    put(UNDEFINED_INSTRUCTION as usize, UDF);
    for (place, instruction) in (START_SECOND_STAGE as usize..)
        .step_by(2)
        .zip(START_SECOND_STAGE_CODE)
    {
        put(place, instruction);
    }
    let entry = SECOND_STAGE | 1;
    put(START_SECOND_STAGE as usize + 8, entry as u16);
    put(START_SECOND_STAGE as usize + 10, (entry >> 16) as u16);
    for sleep in [WAIT_FOR_RESET, USB_BOOT] {
        put(sleep as usize, WFI);
        put(sleep as usize + 2, B_PREVIOUS);
    }
    rom
}

/// Whether the host carries out what is at an address.
#[inline]
pub fn is_function(pc: u32) -> bool {
    // Most programs are not in the ROM.
    pc < FLOAT_TRAPS_END && is_function_of_rom(pc)
}

fn is_function_of_rom(pc: u32) -> bool {
    (TRAPS..=WAIT_FOR_FLASH).contains(&pc) || float_routine_at(pc).is_some()
}

fn float_routine_at(pc: u32) -> Option<FloatRoutine> {
    let number = pc.checked_sub(FLOAT_TRAPS)? / 2;
    FloatRoutine::ALL.get(number as usize).copied()
}

/// Whether what is at an address is executed after a reset and before the program.
pub fn starts_program(pc: u32) -> bool {
    let rom = START_SECOND_STAGE..START_SECOND_STAGE + 2 * START_SECOND_STAGE_CODE.len() as u32;
    let second_stage = SECOND_STAGE..SECOND_STAGE + SECOND_STAGE_BYTES as u32;
    pc == WAIT_FOR_FLASH || rom.contains(&pc) || second_stage.contains(&pc)
}

/// Whether what is at an address goes on only at a later moment, unless there is an interrupt.
pub fn waits(bus: &SystemBus, pc: u32) -> bool {
    let works = |work: &RomWork| work.function == pc && work.end_after(bus.now).is_some();
    bus.memory.flash.is_busy() && waits_for_flash(pc) || bus.rom_work.as_ref().is_some_and(works)
}

/// Whether what is at an address waits while the flash chip is busy.
fn waits_for_flash(pc: u32) -> bool {
    let is_of_flash = |function: &RomFunction| matches!(function.code, b"RE" | b"RP");
    pc == WAIT_FOR_FLASH || function_at(pc).is_some_and(is_of_flash)
}

fn function_at(pc: u32) -> Option<&'static RomFunction> {
    let number = pc.checked_sub(TRAPS)? / 2;
    FUNCTIONS.get((number as usize).checked_sub(1)?)
}

/// Where a function is, with the Thumb bit.
pub fn address_of(code: &[u8; 2]) -> Option<u32> {
    let number = FUNCTIONS.iter().position(|function| function.code == code)?;
    Some((TRAPS + 2 * (1 + number as u32)) | 1)
}

/// Do what the function does at which the processor stands, leave its result in R0 and return to
/// the caller; or do a part of it and stay. Returns the cycles charged.
pub fn call(core: &mut CortexM0Plus, bus: &mut SystemBus) -> u64 {
    let pc = core.regs.pc();
    if waits(bus, pc) {
        bus.attention = true;
        return 0;
    }
    let arguments = [core.reg(0), core.reg(1), core.reg(2), core.reg(3)];
    let outcome = match function_at(pc) {
        Some(function) if function.code == b"UB" => {
            reset_to_usb_boot(core, bus);
            return LOOKUP_CYCLES;
        }
        Some(function) => run(function, pc, arguments, bus),
        None if pc == TRAPS => Some((look_up(arguments[0], arguments[1]), LOOKUP_CYCLES)),
        None => Some(match float_routine_at(pc) {
            Some(routine) => calculate(routine, core, bus),
            None => (arguments[0], LOOKUP_CYCLES),
        }),
    };
    let Some((result, cycles)) = outcome else {
        return 0;
    };
    core.set_reg(0, result);
    core.set_reg(15, core.reg(14) & !1);
    cycles
}

/// What `flash_exit_xip` waits twice for the pads' pulls: 2048 rounds of a loop of three cycles.
const PULL_WAIT_CYCLES: Cycle = 2048 * 3;
/// What it sends to the chip: four bytes after each wait, and two.
const EXIT_XIP_BYTES: u64 = 4 + 4 + 2;
const EXIT_XIP_CYCLES: Cycle = 2 * PULL_WAIT_CYCLES + transfer_cycles(EXIT_XIP_BYTES);

/// A function of the ROM is at work until a moment, in which interrupts can be taken.
#[derive(Clone)]
pub struct RomWork {
    function: u32,
    until: Cycle,
}

impl RomWork {
    /// When it ends, if that is after `now`.
    pub fn end_after(&self, now: Cycle) -> Option<Cycle> {
        (self.until > now).then_some(self.until)
    }
}

/// Whether the function at which the processor stands has worked for so long. Begins that work if it has not.
fn has_worked(bus: &mut SystemBus, pc: u32, cycles: Cycle) -> bool {
    if bus.rom_work.take_if(|work| work.function == pc).is_some() {
        return true;
    }
    bus.rom_work = Some(RomWork {
        function: pc,
        until: bus.now + cycles,
    });
    bus.attention = true;
    false
}

/// Roughly what the ROM's loops take; nothing in a test may depend on it.
const CHANGED: u32 = 0xdead_dead;
const LOOKUP_CYCLES: u64 = 50;
const FLASH_FUNCTION_CYCLES: u64 = 200;

fn look_up(table: u32, code: u32) -> u32 {
    let letters = [code as u8, (code >> 8) as u8];
    match address_of(&letters) {
        Some(address) if table == u32::from(FUNCTION_TABLE) => address,
        _ if table == u32::from(DATA_TABLE) && letters == *b"SF" => u32::from(SOFT_FLOAT_TABLE),
        _ => panic!(
            "the firmware looks up '{}' in the boot ROM's table at {table:#x}, which the emulator's \
             boot ROM does not have",
            String::from_utf8_lossy(&letters)
        ),
    }
}

/// Result and cycles, which count as instructions, too: an instruction of the routines takes little more than a cycle. What
/// the caller has in the registers that a function may change is gone.
fn calculate(routine: FloatRoutine, core: &mut CortexM0Plus, bus: &mut SystemBus) -> (u32, u64) {
    let result = routine.result(core.reg(0), core.reg(1));
    for number in [1, 2, 3, 12] {
        core.set_reg(number, CHANGED);
    }
    bus.instructions += routine.cycles();
    (result, routine.cycles())
}

/// Result and cycles; `None` while the function is not finished.
fn run(function: &RomFunction, pc: u32, arguments: [u32; 4], bus: &mut SystemBus) -> Option<(u32, u64)> {
    let [a, b, c, _] = arguments;
    Some(match function.code {
        b"MC" | b"C4" => {
            for index in 0..c {
                let byte = bus.read8(b.wrapping_add(index));
                bus.write8(a.wrapping_add(index), byte);
            }
            (a, u64::from(c).max(1))
        }
        // The pads lead to the flash chip all the time.
        b"IF" => (a, FLASH_FUNCTION_CYCLES),
        b"EX" => {
            bus.soc.set_up_flash(Ssi::set_up_for_commands, bus.now);
            if !has_worked(bus, pc, EXIT_XIP_CYCLES) {
                return None;
            }
            (a, FLASH_FUNCTION_CYCLES)
        }
        b"CX" => {
            bus.soc.set_up_flash(Ssi::set_up_for_serial_reads, bus.now);
            (a, FLASH_FUNCTION_CYCLES)
        }
        b"FC" => {
            bus.soc.xip_control.flush();
            (a, FLASH_FUNCTION_CYCLES)
        }
        b"RE" => return change_flash(function, pc, Job::erase, arguments, bus),
        b"RP" => return change_flash(function, pc, Job::program, arguments, bus),
        _ => panic!(
            "the firmware called the boot ROM function {} ('{}'), which the emulator does not model",
            function.name,
            String::from_utf8_lossy(function.code)
        ),
    })
}

/// Begin the next operation of the flash chip, or return when there is none. The function is called
/// with the same arguments until then.
fn change_flash(
    function: &RomFunction,
    pc: u32,
    begin: fn([u32; 4]) -> Job,
    arguments: [u32; 4],
    bus: &mut SystemBus,
) -> Option<(u32, u64)> {
    assert!(
        !bus.soc.ssi.serves_reads(),
        "{} was called without flash_exit_xip before it: the chip would not understand",
        function.name
    );
    let mut job = bus.flash_job.take().unwrap_or_else(|| begin(arguments));
    job.check_caller(arguments);
    match job.next_step(bus) {
        Step::Send(bytes) => {
            has_worked(bus, pc, transfer_cycles(bytes));
        }
        Step::Wait(command) => {
            bus.rom_work = None;
            bus.memory.flash.begin(command, bus.now);
            bus.soc.xip_control.is_stale = true;
        }
        Step::Done => return Some((arguments[0], FLASH_FUNCTION_CYCLES)),
    }
    bus.flash_job = Some(job);
    bus.attention = true;
    None
}
