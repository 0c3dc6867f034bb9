//! SPI1: ARM PL022 (datasheet 4.4) as a master in Motorola's format with eight bits, and the devices at
//! its pins, each selected by a pin that SIO drives.
//!
//! Modelled: both 8-deep FIFOs, the time every bit takes, clock polarity and phase as the devices see
//! them, overruns, interrupts, DMA requests. Not modelled, and a panic: slave mode, loopback, other
//! formats and sizes, the receive timeout interrupt. Left out: the pause between frames with SPH 0, and
//! the block's own select output.

mod device;
pub mod devices;
mod registers;
#[cfg(test)]
mod tests;
mod wires;

use std::collections::VecDeque;

use super::clock::{Cycle, NEVER};
pub use device::{SpiClock, SpiDevice, SpiMode};
use registers::Settings;
pub use wires::SpiTransaction;
use wires::Wires;

const FIFO_DEPTH: usize = 8;
/// "RXRIS: four or more entries", "TXRIS: four or fewer" (PL022 TRM, 2.4).
const HALF_FULL: usize = FIFO_DEPTH / 2;

/// Interrupt bits of SSPIMSC, SSPRIS, SSPMIS and SSPICR.
const ROR: u32 = 1;
const RX: u32 = 1 << 2;
const TX: u32 = 1 << 3;

/// Where an SPI block is on the chip.
#[derive(Clone, Copy)]
pub struct SpiPlace {
    pub interrupt_line: u32,
    pub dma_request_tx: u32,
    pub dma_request_rx: u32,
}

/// Which of the pins the test's wires are soldered to lead to the block inside the chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SpiConnection {
    pub sck: bool,
    pub tx: bool,
    pub rx: bool,
}

/// A byte on its way.
#[derive(Clone, Copy, Debug)]
struct Frame {
    byte: u8,
    end: Cycle,
}

#[derive(Clone)]
pub struct Spi {
    place: SpiPlace,
    pins: SpiConnection,
    wires: Wires,
    settings: Settings,
    transmit: VecDeque<u8>,
    receive: VecDeque<u8>,
    shifting: Option<Frame>,
    overrun: bool,
}

impl Spi {
    pub fn new(place: SpiPlace) -> Self {
        Self {
            place,
            pins: SpiConnection::default(),
            wires: Wires::default(),
            settings: Settings::default(),
            transmit: VecDeque::new(),
            receive: VecDeque::new(),
            shifting: None,
            overrun: false,
        }
    }

    /// Put a device on the bus; the pin `select` selects it by a low level. What this pin selected
    /// before is gone.
    pub fn attach(&mut self, select: usize, device: Box<dyn SpiDevice>) {
        self.wires.attach(select, None, device);
    }

    /// Attaches a device whose interrupt output leads to the pin `interrupt`.
    pub fn attach_with_interrupt(&mut self, select: usize, interrupt: usize, device: Box<dyn SpiDevice>) {
        self.wires.attach(select, Some(interrupt), device);
    }

    /// Pins that interrupt outputs of devices drive, each with its level.
    pub fn interrupt_levels(&self) -> impl Iterator<Item = (usize, bool)> {
        self.wires.interrupt_levels()
    }

    /// Take the device that this pin selects off the bus.
    pub fn detach(&mut self, select: usize) {
        self.wires.detach(select);
    }

    /// What the chip reads while no device drives its data line; all ones at first.
    pub fn set_floating(&mut self, byte: u8) {
        self.wires.set_floating(byte);
    }

    /// Take the transactions that are over: from a select to its end.
    pub fn take_transactions(&mut self) -> Vec<SpiTransaction> {
        self.wires.take_log()
    }

    pub fn set_pins(&mut self, pins: SpiConnection, now: Cycle) {
        if pins != self.pins {
            self.advance_to(now);
            self.pins = pins;
        }
    }

    /// The pins that are driven low, one bit each: what they select is selected.
    pub fn observe_selects(&mut self, low_pins: u32, now: Cycle) {
        if self.wires.would_change(low_pins) {
            self.advance_to(now);
            self.wires.select(low_pins, now);
        }
    }

    fn push(&mut self, byte: u8, now: Cycle) {
        if self.transmit.len() < FIFO_DEPTH {
            self.transmit.push_back(byte);
        }
        self.begin(now);
    }

    fn pop(&mut self) -> u32 {
        self.receive.pop_front().unwrap_or(0).into()
    }

    fn is_busy(&self) -> bool {
        self.shifting.is_some() || !self.transmit.is_empty()
    }

    fn raw_interrupts(&self) -> u32 {
        let flag = |is_up, bit| if is_up { bit } else { 0 };
        flag(self.overrun, ROR)
            | flag(self.receive.len() >= HALF_FULL, RX)
            | flag(self.transmit.len() <= HALF_FULL, TX)
    }

    fn begin(&mut self, now: Cycle) {
        if self.shifting.is_some() || !self.settings.is_enabled() {
            return;
        }
        if let Some(byte) = self.transmit.pop_front() {
            let end = now + self.settings.frame();
            self.shifting = Some(Frame { byte, end });
        }
    }

    fn finish(&mut self, frame: Frame) {
        let received = self.exchange(frame);
        match self.receive.len() {
            FIFO_DEPTH => self.overrun = true,
            _ => self.receive.push_back(received),
        }
    }

    /// Without its clock a device sees nothing; an input that leads nowhere is low.
    fn exchange(&mut self, frame: Frame) -> u8 {
        let sent = if self.pins.tx { frame.byte } else { 0 };
        let received = match self.pins.sck {
            true => self.wires.exchange(sent, self.settings.clock()),
            false => self.wires.floating(),
        };
        if self.pins.rx { received } else { 0 }
    }

    fn advance_to(&mut self, now: Cycle) {
        self.begin(now);
        while let Some(frame) = self.shifting.take_if(|frame| frame.end <= now) {
            self.wires.advance(frame.end);
            self.finish(frame);
            self.begin(frame.end);
        }
        self.wires.advance(now);
    }

    fn next_end(&self) -> Cycle {
        let frame = self.shifting.map_or(NEVER, |frame| frame.end);
        frame.min(self.wires.next_event())
    }
}
