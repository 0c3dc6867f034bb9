//! The boot ROM's `flash_range_erase` and `flash_range_program` (datasheet 2.8.3.1.3): one command
//! to the chip after the other, with the processor waiting for each.

use rp2040_emu::core::CoreBus;

use super::super::bus::SystemBus;
use super::super::clock::Cycle;
use super::super::memory::FLASH_SIZE;
use super::operation::{BLOCK_SIZE, Command};
use super::{PAGE_SIZE, SECTOR_SIZE};

/// The command for erasing a block that the model knows: 64 KB.
const BLOCK_ERASE: u32 = 0xd8;

/// Cycles the serial interface takes for a byte: one bit every six cycles (its BAUDR, as the ROM sets it).
const CYCLES_PER_BYTE: Cycle = 8 * 6;

/// What sending bytes to the chip takes, in cycles.
pub const fn transfer_cycles(bytes: u64) -> Cycle {
    bytes * CYCLES_PER_BYTE
}

/// What the ROM does next.
pub enum Step {
    /// Send a command of this many bytes to the chip, with what comes before and after it.
    Send(u64),
    /// Let the chip carry it out, and ask for its state until it has.
    Wait(Command),
    Done,
}

/// What is left to do of a call of one of the two functions.
#[derive(Clone)]
pub struct Job {
    /// The arguments of the call.
    arguments: [u32; 4],
    next: u32,
    end: u32,
    work: Work,
    /// The command that is being sent.
    sent: Option<Command>,
}

#[derive(Clone)]
enum Work {
    /// `flash_range_erase`, with its third and fourth argument.
    Erase { block_size: u32, block_command: u32 },
    /// `flash_range_program`, with the address of the data less that in flash.
    Program { data_less_offset: u32 },
}

impl Job {
    /// `flash_range_erase(addr, count, block_size, block_cmd)`: "addr must be aligned to a
    /// 4096-byte sector, and count must be a multiple of 4096 bytes".
    pub fn erase(arguments: [u32; 4]) -> Self {
        let [offset, count, block_size, block_command] = arguments;
        check("flash_range_erase", offset, count, SECTOR_SIZE);
        assert!(
            block_size.is_power_of_two(),
            "flash_range_erase: a block of {block_size} bytes is not a power of two"
        );
        let block_command = block_command & 0xff;
        Self {
            arguments,
            next: offset,
            end: offset + count,
            work: Work::Erase {
                block_size,
                block_command,
            },
            sent: None,
        }
    }

    /// `flash_range_program(addr, data, count)`: "addr must be aligned to a 256-byte boundary, and
    /// count must be a multiple of 256".
    pub fn program(arguments: [u32; 4]) -> Self {
        let [offset, data, count, _] = arguments;
        check("flash_range_program", offset, count, PAGE_SIZE);
        Self {
            arguments,
            next: offset,
            end: offset + count,
            work: Work::Program {
                data_less_offset: data.wrapping_sub(offset),
            },
            sent: None,
        }
    }

    /// Whether it is this call that goes on, and not another one from an interrupt handler.
    pub fn check_caller(&self, arguments: [u32; 4]) {
        assert_eq!(
            self.arguments, arguments,
            "a boot ROM function for flash was called while another one was at work"
        );
    }

    /// What is next; after each step it is asked for again.
    pub fn next_step(&mut self, bus: &mut SystemBus) -> Step {
        if let Some(command) = self.sent.take() {
            return Step::Wait(command);
        }
        let Some(command) = self.next_command(bus) else {
            return Step::Done;
        };
        let bytes = command.bytes_sent();
        self.sent = Some(command);
        Step::Send(bytes)
    }

    /// The next command for the chip; `None` when all is done.
    fn next_command(&mut self, bus: &mut SystemBus) -> Option<Command> {
        if self.next >= self.end {
            return None;
        }
        let offset = self.next;
        let command = match self.work {
            Work::Erase {
                block_size,
                block_command,
            } => self.erase_command(block_size, block_command),
            Work::Program { data_less_offset } => {
                let data = data_less_offset.wrapping_add(offset);
                let byte = |index| bus.read8(data.wrapping_add(index));
                Command::ProgramPage {
                    offset,
                    data: (0..PAGE_SIZE).map(byte).collect(),
                }
            }
        };
        self.next = command.range().end;
        Some(command)
    }

    /// The ROM uses the larger block wherever it is aligned and fits, a sector elsewhere.
    fn erase_command(&self, block_size: u32, block_command: u32) -> Command {
        let offset = self.next;
        if !offset.is_multiple_of(block_size) || self.end - offset < block_size {
            return Command::EraseSector { offset };
        }
        assert_eq!(
            (block_size, block_command),
            (BLOCK_SIZE, BLOCK_ERASE),
            "flash_range_erase: size and command of a block erase that the emulator does not model"
        );
        Command::EraseBlock { offset }
    }
}

/// The ROM checks nothing and the chip uses what it can of an address: on silicon such a call
/// damages data, so here it fails.
fn check(function: &str, offset: u32, count: u32, unit: u32) {
    assert!(
        offset.is_multiple_of(unit) && count.is_multiple_of(unit),
        "{function}: address {offset:#x} and length {count:#x} must be multiples of {unit}"
    );
    let end = u64::from(offset) + u64::from(count);
    assert!(
        end <= FLASH_SIZE as u64,
        "{function}: {offset:#x} to {end:#x} is not in the {FLASH_SIZE:#x} bytes of flash; addresses start at 0"
    );
}
