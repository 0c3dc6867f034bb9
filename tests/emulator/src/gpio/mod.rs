//! The pins as inputs: the level at each pad, what a test's wires make of it over time, and the
//! interrupts of IO_BANK0 that follow from it (datasheet 2.19.3).
//!
//! The levels of SIO, of an I2C bus, of what a UART receives, of a test's wire and of the pads' pulls
//! reach the inputs; what UART, SPI and PWM send does not. Without any of them an input is noise. An edge
//! of noise, or of what a UART receives, is noticed while its interrupt is enabled. The overrides of GPIO_CTRL, wake from dormant mode, forced interrupts and those
//! of core 1 are not modelled.

mod registers;
#[cfg(test)]
mod tests;
mod wires;

use super::clock::Cycle;
use super::floating::Floating;
pub use registers::is_interrupt_register;
use wires::Wires;
pub use wires::{PinWire, Pulses};

pub const PINS: usize = 30;
const REGISTERS: usize = 4;

/// What the chip makes of its pins inside: sets of pins, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PadState {
    /// Driven by the chip, and driven high.
    pub driven: u32,
    pub driven_high: u32,
    pub pulled_up: u32,
    /// Noise, unless a wire drives them.
    pub may_float: u32,
    pub input_enabled: u32,
}

/// Pins whose level is decided on a bus of its own, whatever else is at them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusLevels {
    pub pins: u32,
    pub high: u32,
}

impl BusLevels {
    pub fn set(&mut self, pin: usize, is_high: bool) {
        self.pins |= 1 << pin;
        self.high |= u32::from(is_high) << pin;
    }
}

#[derive(Clone, Default)]
pub struct Gpio {
    pads: PadState,
    bus: BusLevels,
    wires: Wires,
    noise: Floating,
    /// What a pin without any level is now.
    floating_high: u32,
    /// When that may change.
    noise_changes_at: Cycle,
    /// What the inputs are.
    levels: u32,
    /// Edges since they were cleared.
    fallen: u32,
    risen: u32,
    enable: [u32; REGISTERS],
}

impl Gpio {
    /// Pins that float as `noise` has it.
    pub fn new(noise: Floating) -> Self {
        Self {
            noise,
            ..Self::default()
        }
    }

    /// What the inputs are, as GPIO_IN shows them.
    pub fn levels(&self) -> u32 {
        self.levels
    }

    /// Connect a wire to a pin, or change what is on it, from now on.
    pub fn connect(&mut self, pin: usize, wire: PinWire) {
        self.wires.connect(pin, wire);
        self.follow_levels();
    }

    /// Connects a wire at a time to come.
    pub fn schedule(&mut self, at: Cycle, pin: usize, wire: PinWire) {
        self.wires.schedule(at, pin, wire);
    }

    /// What the chip and the buses make of the pins has changed, or may have.
    pub fn set_pads(&mut self, pads: PadState, bus: BusLevels) {
        if (pads, bus) == (self.pads, self.bus) {
            return;
        }
        (self.pads, self.bus) = (pads, bus);
        self.follow_levels();
    }

    /// A wire against an output of the chip: the chip wins.
    fn pad_levels(&self) -> u32 {
        let (pads, wires) = (&self.pads, &self.wires);
        let wired = wires.connected & !pads.driven;
        let open = !(pads.driven | wired);
        let alone = pads.driven & pads.driven_high
            | wired & wires.high
            | open & pads.pulled_up
            | self.floating() & self.floating_high;
        alone & !self.bus.pins | self.bus.high & self.bus.pins
    }

    /// Pins that neither the chip nor a wire nor a pull gives a level.
    fn floating(&self) -> u32 {
        self.pads.may_float & !(self.pads.driven | self.wires.connected)
    }

    /// A disabled input reads as low (2.19.4).
    fn follow_levels(&mut self) {
        let levels = self.pad_levels() & self.pads.input_enabled;
        self.fallen |= self.levels & !levels;
        self.risen |= levels & !self.levels;
        self.levels = levels;
    }
}
