//! The interrupt registers of IO_BANK0 (datasheet 2.19.6.1): four bits for each pin, eight pins to a
//! register.

use super::super::clock::Cycle;
use super::super::peripheral::Peripheral;
use super::super::register::{RegisterWrite, bit};
use super::{Gpio, PINS};

pub const INTR0: u32 = 0x0f0;
pub const PROC0_INTE0: u32 = 0x100;
const PROC0_INTF0: u32 = 0x110;
pub const PROC0_INTS0: u32 = 0x120;
const PROC0_END: u32 = 0x130;
const ALIAS_AND_OFFSET: u32 = 0xfff;

/// IO_IRQ_BANK0 is NVIC line 13 (2.3.2).
const INTERRUPT_LINE: u32 = 13;
const PINS_PER_REGISTER: usize = 8;

/// The bits of a pin, from the lowest.
const LEVEL_LOW: u32 = 1;
const LEVEL_HIGH: u32 = 1 << 1;
pub const EDGE_LOW: u32 = 1 << 2;
pub const EDGE_HIGH: u32 = 1 << 3;

/// Whether an address of IO_BANK0 belongs to the interrupts of core 0, which are modelled here.
pub fn is_interrupt_register(address: u32) -> bool {
    (INTR0..PROC0_END).contains(&(address & ALIAS_AND_OFFSET))
}

/// The pins of a register, each with the place of its bits.
fn pins_of(register: usize) -> impl Iterator<Item = (usize, u32)> {
    let first = register * PINS_PER_REGISTER;
    (first..PINS.min(first + PINS_PER_REGISTER)).map(move |pin| (pin, 4 * (pin - first) as u32))
}

/// The bits of a register that exist: the last has six pins.
fn mask(register: usize) -> u32 {
    pins_of(register).fold(0, |mask, (_, place)| mask | 0xf << place)
}

impl Gpio {
    /// Levels are what they are, edges stay until they are cleared.
    fn raw(&self, register: usize) -> u32 {
        pins_of(register).fold(0, |raw, (pin, place)| raw | self.events(pin as u32) << place)
    }

    fn events(&self, pin: u32) -> u32 {
        let level = if bit(self.levels, pin) {
            LEVEL_HIGH
        } else {
            LEVEL_LOW
        };
        let fallen = if bit(self.fallen, pin) { EDGE_LOW } else { 0 };
        let risen = if bit(self.risen, pin) { EDGE_HIGH } else { 0 };
        level | fallen | risen
    }

    fn clear_edges(&mut self, register: usize, value: u32) {
        for (pin, place) in pins_of(register) {
            let cleared = value >> place;
            self.fallen &= !(u32::from(cleared & EDGE_LOW != 0) << pin);
            self.risen &= !(u32::from(cleared & EDGE_HIGH != 0) << pin);
        }
    }

    /// Pins with an interrupt that is enabled.
    pub fn watched(&self) -> u32 {
        let registers = self.enable.iter().enumerate();
        registers.fold(0, |watched, (register, &enable)| match enable {
            0 => watched,
            _ => pins_of(register)
                .filter(|(_, place)| enable >> place & 0xf != 0)
                .fold(watched, |watched, (pin, _)| watched | 1 << pin),
        })
    }

    fn status(&self, register: usize) -> u32 {
        match self.enable[register] {
            0 => 0,
            enable => self.raw(register) & enable,
        }
    }
}

impl Peripheral for Gpio {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        let register = (offset >> 2 & 3) as usize;
        match offset & !0xf {
            INTR0 => self.raw(register),
            PROC0_INTE0 => self.enable[register],
            PROC0_INTS0 => self.status(register),
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        let register = (offset >> 2 & 3) as usize;
        match offset & !0xf {
            INTR0 => self.clear_edges(register, write.value),
            PROC0_INTE0 => write.update(&mut self.enable[register], mask(register)),
            PROC0_INTF0 => panic!("IO_BANK0: forced interrupts are not modelled"),
            _ => {}
        }
    }

    /// What is outside the chip goes on.
    fn reset(&mut self, _now: Cycle) {
        *self = Self {
            pads: self.pads,
            bus: self.bus,
            wires: std::mem::take(&mut self.wires),
            noise: self.noise,
            floating_high: self.floating_high,
            levels: self.levels,
            ..Self::default()
        };
    }

    fn advance(&mut self, now: Cycle) {
        if self.floating() != 0 {
            self.floating_high = self.noise.levels_at(now);
            self.noise_changes_at = self.noise.next_change(now);
            self.follow_levels();
        }
        while let Some(changes) = self.wires.take_due(now) {
            for (pin, wire) in changes {
                self.connect(pin, wire);
            }
        }
    }

    fn next_event(&self) -> Cycle {
        let change = self.wires.next_change();
        if self.floating() & self.watched() == 0 {
            return change;
        }
        change.min(self.noise_changes_at)
    }

    fn interrupt_lines(&self) -> u32 {
        let is_up = (0..self.enable.len()).any(|register| self.status(register) != 0);
        u32::from(is_up) << INTERRUPT_LINE
    }
}
