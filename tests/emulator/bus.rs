//! The bus: sends every access of the processor and of the DMA to the memory or the block it is
//! meant for, and reports those that are meant for nobody.

use std::collections::BTreeMap;

use rp2040_emu::Bus as CrateBus;

use super::clock::{CLK_SYS_HZ, Cycle};
use super::dma::{Transfer, TransferEnd};
use super::memory::{Memory, RAM_BASE};
use super::memory_map::{Block, IO_BANK0_BASE, Model, PADS_BANK0_BASE, RESETS_BASE, block_at};
use super::pins::{UartPins, uart_connection};
use super::register::{RegisterWrite, bit};
use super::rtt::RttWatch;
use super::soc::{Id, Soc};
use super::system_control::SystemControl;

/// Size of a bus access in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    Byte = 1,
    Half = 2,
    Word = 4,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Read,
    Write,
}

/// An access nobody answers ("unmapped address ranges raise a bus error when accessed", 2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusError;

/// A bus error as the test sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusErrorRecord {
    pub time_us: u64,
    pub address: u32,
    /// The instruction that was running; for a failed instruction fetch, the address itself.
    pub pc: u32,
    pub direction: Direction,
}

/// Accesses to a block that nobody models.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnmodelledAccess {
    pub block: &'static str,
    pub reads: u64,
    pub writes: u64,
    /// Address and instruction of the first access.
    pub first_address: u32,
    pub first_pc: u32,
}

/// How many bus errors are kept; a program that runs wild makes many.
const BUS_ERROR_RECORDS: usize = 1024;

pub struct SystemBus {
    pub now: Cycle,
    pub memory: Memory,
    pub soc: Soc,
    /// Clocks, PLLs, RESETS, SIO, IO_BANK0, PADS, NVIC and the rest of the PPB.
    pub chip: CrateBus,
    /// The time as far as `chip` knows it.
    chip_now: Cycle,
    pub system_control: SystemControl,
    pub uart_pins: [UartPins; 2],
    /// Something may have changed that the scheduler has to look at before the next instruction.
    pub attention: bool,
    pub rtt: RttWatch,
    /// A failed access of the processor that was not turned into a HardFault yet.
    pub(super) fault: Option<u32>,
    pub(super) pc: u32,
    /// Instructions executed since power-up.
    pub(super) instructions: u64,
    pub(super) stale_code: Vec<u32>,
    /// The part of RAM that instructions were fetched from: stores into it make decoded
    /// instructions stale.
    pub(super) code_in_ram: std::ops::Range<u32>,
    unmodelled_registers: BTreeMap<u32, u32>,
    pub unmodelled: BTreeMap<&'static str, UnmodelledAccess>,
    pub bus_errors: Vec<BusErrorRecord>,
}

impl SystemBus {
    pub fn new(memory: Memory, noise_seed: u64) -> Self {
        Self {
            now: 0,
            memory,
            soc: Soc::new(noise_seed),
            chip: new_chip(),
            chip_now: 0,
            system_control: SystemControl::default(),
            uart_pins: UartPins::DEFAULTS,
            attention: true,
            rtt: RttWatch::default(),
            fault: None,
            pc: 0,
            instructions: 0,
            stale_code: Vec::new(),
            code_in_ram: 0..0,
            unmodelled_registers: BTreeMap::new(),
            unmodelled: BTreeMap::new(),
            bus_errors: Vec::new(),
        }
    }

    /// Reset everything but the memories, the time and what is outside the chip.
    pub fn reset(&mut self) {
        let now = self.now;
        self.chip = new_chip();
        self.system_control = SystemControl::default();
        self.soc.reset(now);
        self.unmodelled_registers.clear();
        self.connect_pins();
        self.reset_processor();
    }

    /// What a reset of the processor alone drops.
    pub fn reset_processor(&mut self) {
        self.fault = None;
        self.code_in_ram = 0..0;
        self.rtt.forget_channel();
        self.attention = true;
    }

    pub fn load(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        if let Some(value) = self.memory.load(address, width) {
            return Ok(value);
        }
        match address >> 28 {
            0x1 | 0x4 | 0x5 => self.load_register(address, width),
            _ => Err(BusError),
        }
    }

    pub fn store(&mut self, address: u32, value: u32, width: Width) -> Result<(), BusError> {
        if self.memory.store(address, value, width).is_some() {
            self.note_stored(address, width);
            return Ok(());
        }
        match address >> 28 {
            0x1 | 0x4 | 0x5 => self.store_register(address, value, width),
            _ => Err(BusError),
        }
    }

    fn note_stored(&mut self, address: u32, width: Width) {
        if self.code_in_ram.contains(&address) {
            self.stale_code.push(address);
            if width == Width::Word {
                self.stale_code.push(address + 2);
            }
        }
        self.rtt.note_stored(address);
    }

    /// Note that an instruction was fetched, for [`Self::note_stored`].
    pub(super) fn note_fetched(&mut self, pc: u32) {
        if pc >= RAM_BASE && !self.code_in_ram.contains(&pc) {
            let (start, end) = match self.code_in_ram.is_empty() {
                true => (pc, pc),
                false => (self.code_in_ram.start, self.code_in_ram.end),
            };
            self.code_in_ram = start.min(pc)..end.max(pc.saturating_add(4));
        }
    }

    /// The registers are read as words; the processor picks its bytes out (datasheet 2.1.4).
    fn load_register(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        let block = block_at(address).ok_or(BusError)?;
        self.attention = true;
        let word = self.read_block(block, address & !3);
        Ok(lane(word, address, width))
    }

    /// "Byte writes are replicated": a narrow store writes the whole register (2.1.4).
    fn store_register(&mut self, address: u32, value: u32, width: Width) -> Result<(), BusError> {
        let block = block_at(address).ok_or(BusError)?;
        self.attention = true;
        self.write_block(block, address & !3, replicated(value, width));
        Ok(())
    }

    /// A block held in reset reads as zero.
    fn read_block(&mut self, block: &Block, address: u32) -> u32 {
        if self.is_held(block) {
            return 0;
        }
        match block.model {
            Model::Own(id) => self.soc.read(id, address & 0xfff, self.now),
            Model::Crate => {
                self.tell_chip_the_time();
                self.chip.read32(address)
            }
            Model::None => {
                self.note_unmodelled(block.name, address, Direction::Read);
                self.unmodelled_registers
                    .get(&(address & !0x3000))
                    .copied()
                    .unwrap_or(0)
            }
        }
    }

    /// A block held in reset takes no writes.
    fn write_block(&mut self, block: &Block, address: u32, value: u32) {
        if self.is_held(block) {
            return;
        }
        let write = RegisterWrite::to_address(address, value);
        match block.model {
            Model::Own(id) => {
                self.soc.write(id, address & 0xfff, write, self.now);
                self.follow_power_state(id);
            }
            Model::Crate => self.write_crate_block(block, address, value),
            Model::None => {
                self.note_unmodelled(block.name, address, Direction::Write);
                let register = self.unmodelled_registers.entry(address & !0x3000).or_default();
                *register = write.applied_to(*register);
            }
        }
    }

    fn write_crate_block(&mut self, block: &Block, address: u32, value: u32) {
        let held_before = self.chip.resets.state;
        self.tell_chip_the_time();
        self.chip.write32(address, value);
        if block.base == RESETS_BASE {
            self.apply_resets(held_before);
        }
        if matches!(block.base, RESETS_BASE | IO_BANK0_BASE | PADS_BANK0_BASE) {
            self.connect_pins();
        }
    }

    /// The crate's PLLs count cycles until they lock.
    fn tell_chip_the_time(&mut self) {
        self.chip.advance_lazy_scheduled(self.now - self.chip_now);
        self.chip_now = self.now;
    }

    fn is_held(&self, block: &Block) -> bool {
        block
            .reset_bit
            .is_some_and(|reset_bit| bit(self.chip.resets.state, reset_bit))
    }

    fn apply_resets(&mut self, held_before: u32) {
        let held_now = self.chip.resets.state;
        self.soc.hold_in_reset(held_before, held_now, self.now);
        let held = |base| block_at(base).is_some_and(|block| self.is_held(block));
        let (io_held, pads_held) = (held(IO_BANK0_BASE), held(PADS_BANK0_BASE));
        if io_held {
            self.chip.io_bank0.reset();
        }
        if pads_held {
            self.chip.pads_bank0.reset();
        }
    }

    /// Forcing a stage off in the PSM resets it; only the SIO is followed here.
    fn follow_power_state(&mut self, written: Id) {
        if written == Id::PowerState && self.soc.power_state.sio_is_down() {
            self.chip.sio.reset();
        }
    }

    /// Tell the UARTs whether the wired pins lead to them.
    pub fn connect_pins(&mut self) {
        for number in 0..self.uart_pins.len() {
            let connection = uart_connection(&self.chip, number, self.uart_pins[number]);
            self.soc.uarts[number].set_pins(connection, self.now);
        }
    }

    pub(super) fn note_unmodelled(&mut self, block: &'static str, address: u32, direction: Direction) {
        let (first_address, first_pc) = (address, self.pc);
        let access = self.unmodelled.entry(block).or_insert(UnmodelledAccess {
            block,
            reads: 0,
            writes: 0,
            first_address,
            first_pc,
        });
        match direction {
            Direction::Read => access.reads += 1,
            Direction::Write => access.writes += 1,
        }
    }

    pub(super) fn note_bus_error(&mut self, address: u32, direction: Direction) {
        if self.bus_errors.len() < BUS_ERROR_RECORDS {
            let time_us = super::clock::micros(self.now);
            self.bus_errors.push(BusErrorRecord {
                time_us,
                address,
                pc: self.pc,
                direction,
            });
        }
    }

    /// Let every peripheral do what is due, then at most one DMA transfer.
    pub fn advance(&mut self) {
        self.soc.advance(self.now);
        if let Some(transfer) = self.soc.dma.next_transfer(self.soc.dma_requests(), self.now) {
            let end = self.carry_out(transfer);
            self.soc.dma.complete(transfer, end, self.now);
            self.soc.advance(self.now);
        }
    }

    fn carry_out(&mut self, transfer: Transfer) -> TransferEnd {
        let Ok(value) = self.load(transfer.from, transfer.width) else {
            self.note_bus_error(transfer.from, Direction::Read);
            return TransferEnd::ReadError;
        };
        let value = self.soc.dma.swap(transfer, value);
        match self.store(transfer.to, value, transfer.width) {
            Ok(()) => TransferEnd::Done,
            Err(BusError) => {
                self.note_bus_error(transfer.to, Direction::Write);
                TransferEnd::WriteError
            }
        }
    }

    /// When [`Self::advance`] is needed next.
    pub fn next_event(&self) -> Cycle {
        let event = self.soc.next_event();
        if !self.soc.dma.is_busy() {
            return event;
        }
        event.min(self.soc.dma.next_transfer_time(self.soc.dma_requests()))
    }
}

/// The crate's bus after reset. Its clock tree and PLL lock counter run at our time base.
fn new_chip() -> CrateBus {
    let mut chip = CrateBus::new();
    chip.seed_sys_clk_hz(CLK_SYS_HZ as u32);
    chip
}

/// The byte lanes an access of this width and address picks from a word.
pub(super) fn lane(word: u32, address: u32, width: Width) -> u32 {
    match width {
        Width::Byte => word >> (8 * (address & 3)) & 0xff,
        Width::Half => word >> (8 * (address & 2)) & 0xffff,
        Width::Word => word,
    }
}

/// A narrow value as it appears on the 32-bit write bus.
pub(super) fn replicated(value: u32, width: Width) -> u32 {
    match width {
        Width::Byte => (value & 0xff) * 0x0101_0101,
        Width::Half => (value & 0xffff) * 0x0001_0001,
        Width::Word => value,
    }
}
