//! UART0 and UART1: ARM PL011 (datasheet 4.2), each with the wire at its pins.
//!
//! Modelled: the 32-character FIFOs and their trigger levels, transmit, receive, receive-timeout
//! and error interrupts, DMA requests, the time every bit takes, framing errors and breaks from a
//! sender at another speed, overruns. Not modelled: parity errors, modem lines and RTS/CTS, IrDA,
//! loopback, sending a break.

mod line;
mod receiver;
mod registers;
mod settings;
#[cfg(test)]
mod tests;
mod transmitter;

use super::clock::{Cycle, NEVER};
use super::peripheral::Peripheral;
use super::register::{bit, field};
pub use line::{BitTime, Line, Pull};
use receiver::{BREAK, FRAMING, Receiver, Reception};
use settings::Settings;
pub use transmitter::SentByte;
use transmitter::Transmitter;

const CR_RESET: u32 = 0x300;
const CR_UARTEN: u32 = 0;
const CR_TXE: u32 = 8;
const CR_RXE: u32 = 9;
const IFLS_RESET: u32 = 0x12;
const DMACR_RXDMAE: u32 = 0;
const DMACR_TXDMAE: u32 = 1;
const DMACR_DMAONERR: u32 = 2;

/// Interrupt bits of UARTIMSC, UARTRIS, UARTMIS and UARTICR.
const RX: u32 = 1 << 4;
const TX: u32 = 1 << 5;
const RT: u32 = 1 << 6;
const FE: u32 = 1 << 7;
const BE: u32 = 1 << 9;
const OE: u32 = 1 << 10;
const ALL_INTERRUPTS: u32 = 0x7ff;
const ERRORS: u32 = FE | 1 << 8 | BE | OE;

/// Where a UART is on the chip.
#[derive(Clone, Copy)]
pub struct UartPlace {
    pub interrupt_line: u32,
    pub dma_request_tx: u32,
    pub dma_request_rx: u32,
}

/// Whether the two pins the test's wire is soldered to are connected to the UART inside the chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PinConnection {
    pub tx: bool,
    pub rx: bool,
    /// How the pad of the receiving pin pulls.
    pub rx_pull: Pull,
}

#[derive(Clone)]
pub struct Uart {
    place: UartPlace,
    pins: PinConnection,
    transmitter: Transmitter,
    receiver: Receiver,
    settings: Settings,
    lcr_h: u32,
    ibrd: u32,
    fbrd: u32,
    cr: u32,
    ifls: u32,
    imsc: u32,
    ris: u32,
    dmacr: u32,
    /// Error flags of the character read last (UARTRSR).
    receive_status: u32,
    sent: Vec<SentByte>,
}

impl Uart {
    /// A UART that receives from `line`.
    pub fn new(place: UartPlace, line: Line) -> Self {
        Self {
            place,
            pins: PinConnection::default(),
            transmitter: Transmitter::default(),
            receiver: Receiver::new(line),
            settings: Settings::latch(0, 0, 0),
            lcr_h: 0,
            ibrd: 0,
            fbrd: 0,
            cr: CR_RESET,
            ifls: IFLS_RESET,
            imsc: 0,
            ris: 0,
            dmacr: 0,
            receive_status: 0,
            sent: Vec::new(),
        }
    }

    /// Everything that left through the wired pin and was not taken yet.
    pub fn sent(&self) -> &[SentByte] {
        &self.sent
    }

    /// Take what left through the wired pin so far.
    pub fn take_sent(&mut self) -> Vec<SentByte> {
        std::mem::take(&mut self.sent)
    }

    /// Characters lost because the receive FIFO was full.
    pub fn overruns(&self) -> u64 {
        self.receiver.overruns
    }

    /// Length of a bit as the firmware programmed it; `None` before it did.
    pub fn programmed_bit(&self) -> Option<BitTime> {
        self.settings.has_baud_rate().then_some(self.settings.bit)
    }

    /// Put bytes on the wire to the receiver, back to back. Returns when the last one is over.
    pub fn send_to_chip(&mut self, bytes: &[u8], start: Cycle, bit: BitTime) -> Cycle {
        self.receiver.line.send(bytes, start, bit);
        self.receiver.line.free_at()
    }

    pub fn set_pins(&mut self, pins: PinConnection, now: Cycle) {
        self.advance(now);
        self.pins = pins;
        self.receiver.line.pull(pins.rx_pull, now);
    }

    /// Take the wire off the receiving pin.
    pub fn disconnect_receiver(&mut self, now: Cycle) {
        self.advance(now);
        self.receiver.line.disconnect(now);
    }

    /// The level at the receiving pin; `None` when the pin does not lead here.
    pub fn received_level(&self, now: Cycle) -> Option<bool> {
        self.pins.rx.then(|| self.receiver.line.level_at(now))
    }

    /// When that may change after `now`.
    pub fn next_received_change(&self, now: Cycle) -> Cycle {
        let change = self.receiver.line.change_after(now);
        change.filter(|_| self.pins.rx).unwrap_or(NEVER)
    }

    fn enabled(&self, half: u32) -> bool {
        bit(self.cr, CR_UARTEN) && bit(self.cr, half)
    }

    fn hears(&self) -> bool {
        self.enabled(CR_RXE) && self.pins.rx && self.settings.has_baud_rate()
    }

    fn tx_trigger(&self) -> usize {
        // Without a FIFO the interrupt comes when the holding register is empty.
        if self.settings.fifo_depth() == 1 {
            0
        } else {
            self.settings.trigger_level(field(self.ifls, 0, 3))
        }
    }

    fn rx_trigger(&self) -> usize {
        self.settings.trigger_level(field(self.ifls, 3, 3))
    }

    fn flags(&self) -> u32 {
        let depth = self.settings.fifo_depth();
        let (tx, rx) = (self.transmitter.level(), self.receiver.level());
        u32::from(tx == 0) << 7
            | u32::from(rx >= depth) << 6
            | u32::from(tx >= depth) << 5
            | u32::from(rx == 0) << 4
            | u32::from(self.transmitter.is_busy()) << 3
            | 1 // CTS: the line is not connected and reads as asserted.
    }

    fn read_data(&mut self) -> u32 {
        let character = u32::from(self.receiver.pop().unwrap_or(0));
        self.receive_status = character >> 8;
        if self.receiver.level() < self.rx_trigger() {
            self.ris &= !RX;
        }
        if self.receiver.level() == 0 {
            self.ris &= !RT;
        }
        character
    }

    fn write_data(&mut self, byte: u8, now: Cycle) {
        self.transmitter.push(byte, &self.settings);
        if self.transmitter.level() > self.tx_trigger() {
            self.ris &= !TX;
        }
        self.transmit(now);
    }

    /// Start the next byte. The transmit interrupt "is based on a transition through a level,
    /// rather than on the level itself" (datasheet 4.2.6.3).
    fn transmit(&mut self, now: Cycle) {
        if !self.enabled(CR_TXE) {
            return;
        }
        let before = self.transmitter.level();
        if self.transmitter.start_next(now, &self.settings) {
            let trigger = self.tx_trigger();
            if before > trigger && self.transmitter.level() <= trigger {
                self.ris |= TX;
            }
        }
    }

    fn deliver(&mut self, byte: SentByte) {
        if self.pins.tx {
            self.sent.push(byte);
        }
    }

    fn advance_transmitter(&mut self, now: Cycle) {
        self.transmit(now);
        while let Some(byte) = self.transmitter.finish(now) {
            self.deliver(byte);
            self.transmit(byte.end);
        }
    }

    fn advance_receiver(&mut self, now: Cycle) {
        while let Some(reception) = self.receiver.advance(now, &self.settings) {
            match reception {
                Reception::Received(flags) => self.note_received(flags),
                Reception::Overrun => self.ris |= OE,
                Reception::Timeout => self.ris |= RT,
                Reception::FalseStart => {}
            }
        }
    }

    fn note_received(&mut self, flags: u16) {
        if flags & FRAMING != 0 {
            self.ris |= FE;
        }
        if flags & BREAK != 0 {
            self.ris |= BE;
        }
        if self.receiver.level() >= self.rx_trigger() {
            self.ris |= RX;
        }
    }
}
