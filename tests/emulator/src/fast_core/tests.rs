//! Every first halfword, each with several states of the processor, here and by the crate.

use super::super::board::Board;
use super::super::firmware::Firmware;
use super::super::memory::RAM_BASE;
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
        0..3 => RAM_BASE + (value % RAM_SIZE as u32 & !3),
        3 => RAM_BASE + value % RAM_SIZE as u32,
        4 => FLASH_BASE + CODE + (value % 0x8_0000 | 1),
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

#[test]
fn every_encoding_does_what_the_crate_does() {
    let firmware = every_encoding();
    let mut boards = [0, 1].map(|_| Board::power_up(&firmware, 1));
    let mut random = Random::new(9);
    let mut fast = 0;
    for round in 0..ROUNDS {
        for opcode in 0..=u16::MAX {
            let mut r: [u32; 16] = std::array::from_fn(|_| register(&mut random));
            r[13] = RAM_BASE + 0x400 + (random.next_u64() as u32 % 0x4_0000 & !3);
            r[15] = FLASH_BASE + CODE + 8 * u32::from(opcode);
            let flags = [0, 1, 2, 3, 4, 5, 8, 9, 10, 11][random.next_u64() as usize % 10] << 28;
            let primask = random.next_u64() as u32 & 1;
            if is_of_a_peripheral(opcode, &r) {
                continue;
            }
            for board in &mut boards {
                board.cpu.restart_with(r, 1 << 24 | flags, primask);
                let chip = &mut board.bus.chip;
                (chip.nvic.pending, chip.ppb.active, chip.ppb.icsr) = (0, 0, 0);
                (chip.wfe_waiting, chip.event_flag) = (false, false);
                board.bus.fault = None;
                board.lowest_stack_pointer = r[SP];
            }
            let [slow, quick] = &mut boards;
            slow.bus.now += slow.cpu.step(&mut slow.bus);
            slow.lowest_stack_pointer = r[SP].min(slow.register(SP));
            let before = quick.bus.instructions;
            let end = quick.bus.now + 1;
            quick
                .cpu
                .run_fast(&mut quick.bus, end, &mut quick.lowest_stack_pointer);
            if quick.bus.instructions == before {
                quick.bus.now += quick.cpu.step(&mut quick.bus);
                quick.lowest_stack_pointer = quick.lowest_stack_pointer.min(quick.register(SP));
            } else {
                fast += 1;
            }
            assert_eq!(
                slow.lowest_stack_pointer, quick.lowest_stack_pointer,
                "{opcode:#06x}"
            );
            let state = |board: &Board| {
                let regs = &board.cpu.core.regs;
                (
                    regs.r,
                    regs.xpsr,
                    regs.primask,
                    board.bus.now,
                    board.bus.instructions,
                    board.bus.pc,
                )
            };
            assert_eq!(
                state(slow),
                state(quick),
                "{opcode:#06x} of {r:x?}, flags {flags:#x}"
            );
        }
        let [slow, quick] = &boards;
        assert!(
            slow.bus.memory.ram == quick.bus.memory.ram,
            "RAM differs after round {round}"
        );
    }
    assert!(fast > ROUNDS * 40_000, "{fast}");
}
