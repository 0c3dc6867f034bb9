//! The bus: sends every access of the processor and of the DMA to the memory or the block it is
//! meant for, and reports those to unmapped addresses.

use std::collections::BTreeMap;

use super::access_log::{AccessLog, Direction};
use super::boot_rom::RomWork;
use super::chip::Chip;
use super::clock::{Cycle, NEVER};
use super::dma::{self, Transfer, TransferError};
use super::flash::Job;
use super::memory::{Memory, RAM_BASE, is_cached_flash, is_flash};
use super::mpu::Mpu;
use super::pin_record::PinRecorder;
use super::pins::{I2cPins, PinSettings, SpiPins, UartPins};
use super::random::Random;
use super::rtt::RttWatch;
use super::soc::Soc;
use super::system_control::SystemControl;

/// Size of a bus access in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    Byte = 1,
    Half = 2,
    Word = 4,
}

/// Above the registers of XIP_SSI, and their aliases.
const XIP_END: u32 = 0x1900_0000;

/// An access to no block ("unmapped address ranges raise a bus error when accessed", 2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusError;

#[derive(Clone)]
pub struct SystemBus {
    pub now: Cycle,
    pub memory: Memory,
    pub soc: Soc,
    /// Progress of the converter's results, which may be behind.
    pub(super) stream_time: Cycle,
    /// Clocks, PLLs, RESETS, SIO, IO_BANK0, PADS, NVIC and the rest of the PPB.
    pub chip: Chip,
    pub system_control: SystemControl,
    pub uart_pins: [UartPins; 2],
    pub i2c_pins: [I2cPins; 2],
    pub spi1_pins: SpiPins,
    pub(super) pin_settings: PinSettings,
    pub(super) pin_recorder: PinRecorder,
    /// Something may have changed that the scheduler has to look at before the next instruction.
    pub attention: bool,
    pub rtt: RttWatch,
    /// Below RAM, stores vanish and loads are zero, instead of a bus error.
    pub(super) answers_below_ram: bool,
    /// A failed access of the processor that was not turned into a HardFault yet.
    pub(super) fault: Option<u32>,
    pub(super) pc: u32,
    /// Instructions executed since power-up.
    pub(super) instructions: u64,
    pub(super) stale_code: Vec<u32>,
    /// Flash was changed: all decoded instructions may be stale.
    pub(super) all_code_is_stale: bool,
    /// The boot ROM function for flash that is at work.
    pub(super) flash_job: Option<Job>,
    /// What a boot ROM function does while the processor stands at it.
    pub(super) rom_work: Option<RomWork>,
    /// The pages of RAM that instructions were fetched from: a store into one makes what was decoded of it stale.
    pub(super) code_pages: [bool; CODE_PAGES],
    pub(super) unmodelled_registers: BTreeMap<u32, u32>,
    pub accesses: AccessLog,
    /// What the ring oscillator gives.
    pub(super) random_bits: Random,
}

impl SystemBus {
    pub fn new(memory: Memory, noise_seed: u64) -> Self {
        Self {
            now: 0,
            memory,
            soc: Soc::new(noise_seed),
            stream_time: 0,
            chip: Chip::new(),
            system_control: SystemControl::default(),
            uart_pins: UartPins::DEFAULTS,
            i2c_pins: I2cPins::DEFAULTS,
            spi1_pins: SpiPins::DEFAULT,
            pin_settings: PinSettings::default(),
            pin_recorder: PinRecorder::default(),
            attention: true,
            rtt: RttWatch::default(),
            answers_below_ram: false,
            fault: None,
            pc: 0,
            instructions: 0,
            stale_code: Vec::new(),
            all_code_is_stale: false,
            flash_job: None,
            rom_work: None,
            code_pages: [false; CODE_PAGES],
            unmodelled_registers: BTreeMap::new(),
            accesses: AccessLog::default(),
            random_bits: Random::new(!noise_seed),
        }
    }

    /// Reset everything but the memories, the time and what is outside the chip.
    pub fn reset(&mut self) {
        let now = self.now;
        self.advance_stream();
        self.chip = Chip::new();
        self.system_control = SystemControl::default();
        self.soc.reset(now);
        self.unmodelled_registers.clear();
        self.connect_pins();
        self.observe_circuit();
        self.observe_pins();
        self.reset_processor();
    }

    /// What a reset of the processor alone drops.
    pub fn reset_processor(&mut self) {
        self.fault = None;
        self.system_control.mpu = Mpu::default();
        self.flash_job = None;
        self.rom_work = None;
        self.code_pages = [false; CODE_PAGES];
        self.rtt.forget_channel();
        self.attention = true;
    }

    #[inline]
    pub fn load(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        if is_flash(address) {
            self.read_flash(address);
        }
        if let Some(value) = self.memory.load(address, width) {
            return Ok(value);
        }
        match address >> 28 {
            _ if self.answers(address) => Ok(0),
            0x1 | 0x4 | 0x5 => self.load_register(address, width),
            _ => Err(BusError),
        }
    }

    #[inline]
    pub fn store(&mut self, address: u32, value: u32, width: Width) -> Result<(), BusError> {
        if self.memory.store(address, value, width).is_some() {
            self.note_stored(address);
            return Ok(());
        }
        if is_cached_flash(address) {
            self.note_unmodelled("flash (store ignored)", address, Direction::Write);
            return Ok(());
        }
        match address >> 28 {
            _ if self.answers(address) => Ok(()),
            0x1 | 0x4 | 0x5 => self.store_register(address, value, width),
            _ => Err(BusError),
        }
    }

    /// Whether nothing is there, and a test has it answer all the same.
    fn answers(&self, address: u32) -> bool {
        self.answers_below_ram && (XIP_END..RAM_BASE).contains(&address)
    }

    #[inline]
    fn read_flash(&mut self, address: u32) {
        self.check_flash_readable(address);
        self.soc.xip_control.cache.read(address);
    }

    /// On silicon, reading flash while it cannot be read gives other bytes than it holds, or stops
    /// the processor for good; interrupt handlers in flash and DMA from flash are how it happens.
    #[inline]
    fn check_flash_readable(&self, address: u32) {
        if !self.flash_is_readable() {
            self.refuse_to_read_flash(address);
        }
    }

    #[inline]
    pub(super) fn flash_is_readable(&self) -> bool {
        let (ssi, control) = (&self.soc.ssi, &self.soc.xip_control);
        ssi.serves_reads() && !control.is_stale && !self.memory.flash.is_busy()
    }

    #[cold]
    fn refuse_to_read_flash(&self, address: u32) -> ! {
        panic!(
            "flash is read at {address:#x} (program counter {:#x}) while it cannot be: chip busy: {}, \
             interface set up for reads: {}, cache not flushed after a change: {}",
            self.pc,
            self.memory.flash.is_busy(),
            self.soc.ssi.serves_reads(),
            self.soc.xip_control.is_stale
        );
    }

    /// What was decoded from flash is no longer what it holds.
    pub(super) fn flash_has_changed(&mut self) {
        self.all_code_is_stale = true;
    }

    #[inline]
    fn note_stored(&mut self, address: u32) {
        let page = code_page(address);
        if self.code_pages.get(page).is_some_and(|is_code| *is_code) {
            self.code_pages[page] = false;
            let start = RAM_BASE + (page as u32) * CODE_PAGE_BYTES;
            self.stale_code
                .extend((start - 2..start + CODE_PAGE_BYTES).step_by(2));
        }
        self.rtt.note_stored(address);
    }

    /// Note that an instruction was fetched, for [`Self::note_stored`].
    #[inline]
    pub(super) fn note_fetched(&mut self, pc: u32) {
        if is_flash(pc) {
            self.read_flash(pc);
        } else if pc >= RAM_BASE {
            for address in [pc, pc.wrapping_add(3)] {
                if let Some(is_code) = self.code_pages.get_mut(code_page(address)) {
                    *is_code = true;
                }
            }
        }
    }

    pub(super) fn note_unmodelled(&mut self, block: &'static str, address: u32, direction: Direction) {
        self.accesses.note_unmodelled(block, self.pc, address, direction);
    }

    pub(super) fn note_bus_error(&mut self, address: u32, direction: Direction) {
        self.accesses
            .note_bus_error(self.now, self.pc, address, direction);
    }

    /// Let every peripheral do what is due, then at most one DMA transfer.
    pub fn advance(&mut self) {
        self.show_circuit_to_devices();
        self.soc.advance(self.now);
        if self.memory.flash.advance(self.now) {
            self.flash_has_changed();
        }
        self.advance_stream_if_observed();
        self.make_transfer();
        self.observe_pins();
    }

    /// A transfer of a channel outside of the converter's stream.
    fn make_transfer(&mut self) {
        if self.next_transfer().is_none() {
            return;
        }
        self.advance_stream();
        if let Some(transfer) = self.next_transfer() {
            let end = self.carry_out(transfer);
            self.soc.dma.complete(transfer, end, self.now);
            self.soc.advance(self.now);
        }
    }

    fn next_transfer(&self) -> Option<Transfer> {
        let channels = self.channels_outside_stream();
        if !self.soc.dma.is_busy(channels) {
            return None;
        }
        self.soc
            .dma
            .next_transfer(channels, self.soc.dma_requests(), self.now)
    }

    fn channels_outside_stream(&self) -> u32 {
        dma::CHANNEL_MASK & !self.soc.dma.stream().channels
    }

    fn carry_out(&mut self, transfer: Transfer) -> Result<(), TransferError> {
        if self.soc.dma.take_failure(transfer.channel) {
            return Err(TransferError::Read);
        }
        let loaded = self.load(transfer.from, transfer.width);
        // A miss delays the DMA, which is not modelled, and not the processor.
        self.soc.xip_control.cache.take_waiting();
        let Ok(value) = loaded else {
            self.note_bus_error(transfer.from, Direction::Read);
            return Err(TransferError::Read);
        };
        let stored = self.store(transfer.to, value, transfer.width);
        stored.map_err(|BusError| {
            self.note_bus_error(transfer.to, Direction::Write);
            TransferError::Write
        })
    }

    /// When [`Self::advance`] is needed next.
    pub fn next_event(&self) -> Cycle {
        let rom_work = self.rom_work.as_ref().and_then(|work| work.end_after(self.now));
        let event = self
            .soc
            .next_event()
            .min(self.memory.flash.next_event())
            .min(self.next_change_for_processor())
            .min(self.next_observed_stream_event())
            .min(rom_work.unwrap_or(NEVER));
        let channels = self.channels_outside_stream();
        if !self.soc.dma.is_busy(channels) {
            return event;
        }
        let requests = self.soc.dma_requests();
        event.min(self.soc.dma.next_transfer_time(channels, requests))
    }
}

/// How finely it is known which RAM holds decoded instructions.
pub(super) const CODE_PAGE_BYTES: u32 = 256;
pub(super) const CODE_PAGES: usize = super::memory::RAM_SIZE / CODE_PAGE_BYTES as usize;

#[inline]
pub(super) fn code_page(address: u32) -> usize {
    (address.wrapping_sub(RAM_BASE) / CODE_PAGE_BYTES) as usize
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
