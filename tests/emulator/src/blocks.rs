//! Accesses to the registers of peripheral blocks, and what a write to one block does to others.

use std::ops::RangeInclusive;

use super::access_log::Direction;
use super::bus::{BusError, SystemBus, Width, lane, replicated};
use super::gpio::is_interrupt_register;
use super::memory_map::{
    Block, IO_BANK0_BASE, IO_BANK0_RESET, Model, PADS_BANK0_BASE, RESETS_BASE, block_at,
};
use super::peripheral::Peripheral;
use super::pins::{PinSettings, i2c_connection, spi_connection, uart_connection};
use super::register::{RegisterWrite, bit};
use super::sio::Sio;
use super::soc::Id;

/// What is read of these changes nothing, and they change at events only: TIMERAWH and TIMERAWL, CS and RESULT of the ADC,
/// SSPSR of SPI1.
const QUIET_READS: [u32; 5] = [0x4005_4024, 0x4005_4028, 0x4004_c000, 0x4004_c004, 0x4004_000c];
/// The watchdog's scratch registers only keep what is written.
const QUIET_WRITES: RangeInclusive<u32> = 0x4005_800c..=0x4005_8028;
/// ROSC_RANDOMBIT (2.17.7).
const ROSC_RANDOM_BIT: u32 = 0x4006_001c;

impl SystemBus {
    /// The registers are read as words; the processor picks its bytes out (datasheet 2.1.4).
    pub(super) fn load_register(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        let block = block_at(address).ok_or(BusError)?;
        self.attention |= !QUIET_READS.contains(&(address & !3));
        self.accesses.note_read(self.now, address & !3);
        let word = self.read_block(block, address & !3);
        Ok(lane(word, address, width))
    }

    /// "Byte writes are replicated": a narrow store writes the whole register (2.1.4).
    pub(super) fn store_register(&mut self, address: u32, value: u32, width: Width) -> Result<(), BusError> {
        let block = block_at(address).ok_or(BusError)?;
        if QUIET_WRITES.contains(&address) {
            self.write_block(block, address & !3, replicated(value, width));
            return Ok(());
        }
        self.attention = true;
        if block.model == Model::UsbMemory {
            self.store_usb_memory(block, address, value, width);
            return Ok(());
        }
        self.write_block(block, address & !3, replicated(value, width));
        if drives_pins(block) {
            self.observe_circuit();
        }
        self.observe_pins();
        Ok(())
    }

    /// A block held in reset reads as zero.
    fn read_block(&mut self, block: &Block, address: u32) -> u32 {
        self.advance_stream_before(block);
        if self.is_held(block) {
            return 0;
        }
        match block.model {
            Model::Own(id) => self.soc.read(id, address & 0xfff, self.now),
            Model::UsbMemory => self.soc.usb.dpram_word(address & 0x3fff),
            Model::Crate if is_gpio_interrupt(block, address) => {
                self.soc.read(Id::Gpio, address & 0xfff, self.now)
            }
            Model::Crate if address == ROSC_RANDOM_BIT => self.random_bits.next_u64() as u32 & 1,
            Model::Crate => self.chip.read(block, address, self.now),
            Model::Storage => self.stored_register(address),
            Model::None => {
                self.note_unmodelled(block.name, address, Direction::Read);
                self.stored_register(address)
            }
        }
    }

    /// It has no aliases, and takes bytes and halves as they are (4.1.2.5).
    fn store_usb_memory(&mut self, block: &Block, address: u32, value: u32, width: Width) {
        if !self.is_held(block) {
            let length = width as usize;
            self.soc
                .usb
                .store_dpram(address & 0x3fff, value, length, self.now);
        }
    }

    /// A block held in reset takes no writes.
    fn write_block(&mut self, block: &Block, address: u32, value: u32) {
        self.advance_stream_before(block);
        if self.is_held(block) {
            return;
        }
        let write = RegisterWrite::to_address(address, value);
        match block.model {
            Model::Own(id) => {
                self.soc.write(id, address & 0xfff, write, self.now);
                self.follow_power_state(id);
            }
            Model::Crate if is_gpio_interrupt(block, address) => {
                self.soc.write(Id::Gpio, address & 0xfff, write, self.now);
            }
            Model::Crate => self.write_crate_block(block, address, value),
            Model::Storage => self.store_into_register(address, write),
            Model::UsbMemory => {}
            Model::None => {
                self.note_unmodelled(block.name, address, Direction::Write);
                self.store_into_register(address, write);
            }
        }
    }

    /// What is read has to be of the present, and what came before a change is done as it was before.
    fn advance_stream_before(&mut self, block: &Block) {
        if matches!(block.model, Model::Own(Id::Adc | Id::Dma)) || block.base == RESETS_BASE {
            self.advance_stream();
        }
    }

    fn stored_register(&self, address: u32) -> u32 {
        let register = self.unmodelled_registers.get(&(address & !0x3000));
        register.copied().unwrap_or(0)
    }

    fn store_into_register(&mut self, address: u32, write: RegisterWrite) {
        let register = self.unmodelled_registers.entry(address & !0x3000).or_default();
        *register = write.applied_to(*register);
    }

    fn write_crate_block(&mut self, block: &Block, address: u32, value: u32) {
        let held_before = self.chip.resets.state;
        self.chip.write(block, address, value, self.now);
        if block.base == RESETS_BASE {
            self.apply_resets(held_before);
        }
        if matches!(block.base, RESETS_BASE | IO_BANK0_BASE | PADS_BANK0_BASE) {
            self.connect_pins();
        }
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
        if bit(held_before | held_now, IO_BANK0_RESET) {
            self.soc.gpio.reset(self.now);
        }
        if pads_held {
            self.chip.pads_bank0.reset();
        }
    }

    /// Forcing a stage off in the PSM resets it; only the SIO is followed here.
    fn follow_power_state(&mut self, written: Id) {
        if written == Id::PowerState && self.soc.power_state.sio_is_down() {
            self.chip.sio = Sio::default();
        }
    }

    /// Pass to the blocks whether the wired pins lead to them.
    pub fn connect_pins(&mut self) {
        self.pin_settings = PinSettings::of(&self.chip);
        for number in 0..self.uart_pins.len() {
            let connection = uart_connection(&self.chip, number, self.uart_pins[number]);
            self.soc.uarts[number].set_pins(connection, self.now);
        }
        for (i2c, pins) in self.soc.i2cs.iter_mut().zip(self.i2c_pins) {
            i2c.connect(i2c_connection(&self.chip, pins), self.now);
        }
        let connection = spi_connection(&self.chip, self.spi1_pins);
        self.soc.spi1.set_pins(connection, self.now);
    }
}

/// Whether the levels at pins depend on its registers. Those of SIO are elsewhere, and a PIO goes on without being written to.
fn drives_pins(block: &Block) -> bool {
    matches!(block.model, Model::Own(Id::Pwm | Id::PowerState))
        || matches!(block.base, RESETS_BASE | IO_BANK0_BASE | PADS_BANK0_BASE)
}

/// IO_BANK0 is the crate's but for the interrupts of core 0.
fn is_gpio_interrupt(block: &Block, address: u32) -> bool {
    block.base == IO_BANK0_BASE && is_interrupt_register(address)
}
