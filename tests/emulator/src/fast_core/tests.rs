//! Every first halfword, each with several states of the processor, here and by the crate.

use super::super::board::Board;
use super::super::bus::Width;
use super::super::firmware::Firmware;
use super::super::random::Random;
use super::*;

const CODE: u32 = 0x1000;
const ROUNDS: usize = 6;

/// Eight bytes for each first halfword; what follows it is of any kind, and often a second halfword that means something.
fn every_encoding() -> Firmware {
    let mut random = Random::new(5);
    let mut flash = vec![0xff; FLASH_SIZE];
    for opcode in 0..=u16::MAX {
        let second = match random.next_u64() % 4 {
            0 => 0xd000 | random.next_u64() as u16,
            1 => 0x8010 | (random.next_u64() as u16 & 0x0f00),
            2 => 0x8f40 | (random.next_u64() as u16 & 0x3f),
            _ => random.next_u64() as u16,
        };
        let at = (CODE + 8 * u32::from(opcode)) as usize;
        flash[at..at + 2].copy_from_slice(&opcode.to_le_bytes());
        flash[at + 2..at + 4].copy_from_slice(&second.to_le_bytes());
    }
    // Vectors.
    for word in 0..48 {
        let at = 0x100 + 4 * word;
        flash[at..at + 4].copy_from_slice(&(FLASH_BASE + CODE + 1).to_le_bytes());
    }
    Firmware::from_flash(flash)
}

fn register(random: &mut Random) -> u32 {
    let value = random.next_u64() as u32;
    match random.next_u64() % 8 {
        0..3 => RAM_BASE + (value % RAM_SIZE as u32) / 4 * 4,
        3 => RAM_BASE + value % RAM_SIZE as u32,
        4 => FLASH_BASE + CODE + ((value % 0x8_0000) | 1),
        5 => value % 64,
        6 => [0, 1, u32::MAX, 1 << 31, RAM_BASE + RAM_SIZE as u32 - 4, RAM_BASE][value as usize % 6],
        _ => value & 0x0fff_ffff,
    }
}

fn is_of_a_peripheral(opcode: u16, r: &[u32; 16]) -> bool {
    let i = Instruction { opcode, pc: 0 };
    let of_pair = r[i.low(3)].wrapping_add(r[i.low(6)]);
    (0x50..0x60).contains(&(opcode >> 8)) && of_pair >= RAM_BASE + 0x1000_0000
        || (0x60..0xd0).contains(&(opcode >> 8)) && r.iter().any(|r| *r >= 0x3000_0000 && *r < 0xffff_f000)
}

/// What an instruction can change, but for RAM.
#[derive(Debug, PartialEq)]
struct State {
    r: [u32; 16],
    xpsr: u32,
    primask: u32,
    now: Cycle,
    instructions: u64,
    pc: u32,
    lowest_stack_pointer: u32,
}

impl State {
    fn of(board: &Board) -> Self {
        let regs = &board.cpu.core.regs;
        Self {
            r: regs.r,
            xpsr: regs.xpsr,
            primask: regs.primask,
            now: board.bus.now,
            instructions: board.bus.instructions,
            pc: board.bus.pc,
            lowest_stack_pointer: board.lowest_stack_pointer,
        }
    }
}

/// Where an instruction in RAM stands.
const IN_RAM: u32 = RAM_BASE + 0x200;

/// Puts an instruction and what follows it into RAM.
fn copy_to_ram(board: &mut Board, opcode: u16) {
    for offset in [0, 4] {
        let from = FLASH_BASE + CODE + 8 * u32::from(opcode) + offset;
        let word = board.bus.memory.load(from, Width::Word).unwrap();
        board.bus.store(IN_RAM + offset, word, Width::Word).unwrap();
    }
}

/// In thread mode, with nothing pending.
fn prepare(board: &mut Board, r: [u32; 16], flags: u32, primask: u32) {
    board.cpu.restart_with(r, 1 << 24 | flags, primask);
    let chip = &mut board.bus.chip;
    (chip.nvic.pending, chip.ppb.active, chip.ppb.icsr) = (0, 0, 0);
    (chip.wfe_waiting, chip.event_flag) = (false, false);
    board.bus.fault = None;
    board.lowest_stack_pointer = r[SP];
}

fn step_by_crate(board: &mut Board) {
    board.bus.now += board.cpu.step(&mut board.bus);
    board.bus.now += board.bus.soc.xip_control.cache.take_waiting();
    board.lowest_stack_pointer = board.lowest_stack_pointer.min(board.register(SP));
}

/// Whether the instruction is one of the fast ones, and was executed so.
fn step_fast(board: &mut Board) -> bool {
    let before = board.bus.instructions;
    let end = board.bus.now + 1;
    board
        .cpu
        .run_fast(&mut board.bus, end, &mut board.lowest_stack_pointer);
    board.bus.instructions != before
}

#[test]
fn every_encoding_does_what_the_crate_does() {
    let firmware = every_encoding();
    let [mut slow, mut quick] = [0, 1].map(|_| Board::power_up(&firmware, 1));
    let mut random = Random::new(9);
    let mut fast = 0;
    for round in 0..ROUNDS {
        for opcode in 0..=u16::MAX {
            let mut r: [u32; 16] = std::array::from_fn(|_| register(&mut random));
            r[SP] = RAM_BASE + 0x400 + (random.next_u64() as u32 % 0x4_0000) / 4 * 4;
            r[PC] = FLASH_BASE + CODE + 8 * u32::from(opcode);
            // N and Z at once are left to the crate, and seen there.
            let flags = [0, 1, 2, 3, 4, 5, 8, 9, 10, 11][random.next_u64() as usize % 10] << 28;
            let primask = random.next_u64() as u32 & 1;
            if is_of_a_peripheral(opcode, &r) {
                continue;
            }
            if round % 2 == 1 {
                r[PC] = IN_RAM;
                copy_to_ram(&mut slow, opcode);
                copy_to_ram(&mut quick, opcode);
            }
            prepare(&mut slow, r, flags, primask);
            prepare(&mut quick, r, flags, primask);
            step_by_crate(&mut slow);
            match step_fast(&mut quick) {
                true => fast += 1,
                false => step_by_crate(&mut quick),
            }
            let message = format_args!("{opcode:#06x} of {r:x?}, flags {flags:#x}");
            assert_eq!(State::of(&slow), State::of(&quick), "{message}");
        }
        let same = slow.bus.memory.ram == quick.bus.memory.ram;
        assert!(same, "RAM differs after round {round}");
    }
    assert!(fast > ROUNDS * 40_000, "{fast}");
}
