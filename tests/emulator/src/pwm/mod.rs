//! PWM: eight slices with two outputs each (datasheet 4.5).
//!
//! Nothing is counted cycle by cycle: counter and levels are worked out when they are read, so a
//! slice that runs costs nothing. The only events are the wraps at which something that was written
//! comes into force, for those who record a pin. Interrupts, the DMA request, the input modes,
//! phase-correct counting and inverted outputs are not modelled; using them is a panic.

mod slice;
#[cfg(test)]
mod tests;

use super::clock::{Cycle, NEVER};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit};
pub use slice::Slice;

const SLICES: usize = 8;
const SLICE_BYTES: u32 = 0x14;
const EN: u32 = 0xa0;
const INTR: u32 = 0xa4;
const INTS: u32 = 0xb0;

/// What a slice makes of an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PwmOutput {
    /// 0 for a slice that is disabled: its output is held.
    pub frequency_hz: f64,
    /// The share of the period in which the output is high: exactly 0 or 1 when it never changes.
    pub duty: f64,
}

#[derive(Clone)]
pub struct Pwm {
    slices: [Slice; SLICES],
}

impl Pwm {
    pub fn new() -> Self {
        Self {
            slices: [Slice::after_reset(0); SLICES],
        }
    }

    /// The level of the output that leads to a pin whose function is PWM.
    pub fn level(&self, pin: usize, now: Cycle) -> bool {
        let (slice, channel) = place(pin);
        self.slices[slice].at(now).level(channel)
    }

    /// The slice and the channel that lead to a pin, as they are now.
    pub fn slice_of(&self, pin: usize) -> (Slice, usize) {
        let (slice, channel) = place(pin);
        (self.slices[slice], channel)
    }

    /// What the slice of a pin makes of the pin's output.
    pub fn output(&self, pin: usize, now: Cycle) -> PwmOutput {
        let (slice, channel) = place(pin);
        self.slices[slice].at(now).output(channel)
    }

    fn enabled(&self) -> u32 {
        let enabled = |(number, slice): (usize, &Slice)| (slice.read(slice::CSR) & 1) << number;
        self.slices.iter().enumerate().map(enabled).sum()
    }
}

/// The slice and its channel that drive a pin: GPIO 0 to 15 are slices 0 to 7, A and B in turn, and
/// from GPIO 16 on it starts again (4.5.2).
fn place(pin: usize) -> (usize, usize) {
    (pin / 2 % SLICES, pin % 2)
}

impl Peripheral for Pwm {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            0..EN => self.slices[(offset / SLICE_BYTES) as usize].read(offset % SLICE_BYTES),
            EN => self.enabled(),
            INTR..=INTS => panic!("PWM: interrupts are not modelled"),
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        match offset {
            0..EN => self.slices[(offset / SLICE_BYTES) as usize].write(offset % SLICE_BYTES, write),
            EN => {
                let enabled = write.applied_to(self.enabled());
                for (number, slice) in self.slices.iter_mut().enumerate() {
                    slice.set_enabled(bit(enabled, number as u32));
                }
            }
            INTR..=INTS => panic!("PWM: interrupts are not modelled"),
            _ => {}
        }
    }

    fn reset(&mut self, now: Cycle) {
        self.slices = [Slice::after_reset(now); SLICES];
    }

    fn advance(&mut self, now: Cycle) {
        for slice in &mut self.slices {
            slice.advance(now);
        }
    }

    fn next_event(&self) -> Cycle {
        self.slices.iter().map(Slice::next_latch).min().unwrap_or(NEVER)
    }
}
