//! The registers of a UART (datasheet 4.2.8).

use super::super::clock::{Cycle, NEVER};
use super::super::peripheral::Peripheral;
use super::super::register::{RegisterWrite, bit};
use super::settings::Settings;
use super::{ALL_INTERRUPTS, CR_RXE, CR_TXE, DMACR_DMAONERR, DMACR_RXDMAE, DMACR_TXDMAE, ERRORS, Line, Uart};

pub const UARTDR: u32 = 0x00;
pub const UARTRSR: u32 = 0x04;
pub const UARTFR: u32 = 0x18;
pub const UARTIBRD: u32 = 0x24;
pub const UARTFBRD: u32 = 0x28;
pub const UARTLCR_H: u32 = 0x2c;
pub const UARTCR: u32 = 0x30;
pub const UARTIFLS: u32 = 0x34;
pub const UARTIMSC: u32 = 0x38;
pub const UARTRIS: u32 = 0x3c;
pub const UARTMIS: u32 = 0x40;
pub const UARTICR: u32 = 0x44;
pub const UARTDMACR: u32 = 0x48;
const PERIPHERAL_ID: [(u32, u32); 8] = [
    (0xfe0, 0x11),
    (0xfe4, 0x10),
    (0xfe8, 0x34),
    (0xfec, 0x00),
    (0xff0, 0x0d),
    (0xff4, 0xf0),
    (0xff8, 0x05),
    (0xffc, 0xb1),
];

impl Peripheral for Uart {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            UARTDR => self.read_data(),
            UARTRSR => self.receive_status,
            UARTFR => self.flags(),
            UARTIBRD => self.ibrd,
            UARTFBRD => self.fbrd,
            UARTLCR_H => self.lcr_h,
            UARTCR => self.cr,
            UARTIFLS => self.ifls,
            UARTIMSC => self.imsc,
            UARTRIS => self.ris,
            UARTMIS => self.ris & self.imsc,
            UARTDMACR => self.dmacr,
            _ => PERIPHERAL_ID
                .iter()
                .find(|id| id.0 == offset)
                .map_or(0, |id| id.1),
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        match offset {
            UARTDR => self.write_data(write.value as u8, now),
            UARTRSR => self.receive_status = 0,
            UARTIBRD => write.update(&mut self.ibrd, 0xffff),
            UARTFBRD => write.update(&mut self.fbrd, 0x3f),
            UARTLCR_H => {
                write.update(&mut self.lcr_h, 0xff);
                self.settings = Settings::latch(self.lcr_h, self.ibrd, self.fbrd);
            }
            UARTCR => write.update(&mut self.cr, 0xff87),
            UARTIFLS => write.update(&mut self.ifls, 0x3f),
            UARTIMSC => write.update(&mut self.imsc, ALL_INTERRUPTS),
            UARTICR => self.ris &= !write.value,
            UARTDMACR => write.update(&mut self.dmacr, 0b111),
            _ => {}
        }
    }

    fn reset(&mut self, now: Cycle) {
        let mut receiver = std::mem::take(&mut self.receiver);
        receiver.reset(now);
        *self = Self {
            pins: self.pins,
            receiver,
            sent: std::mem::take(&mut self.sent),
            ..Self::new(self.place, Line::default())
        };
    }

    fn advance(&mut self, now: Cycle) {
        self.advance_transmitter(now);
        if self.hears() {
            self.advance_receiver(now);
        } else {
            self.receiver.ignore_until(now);
        }
    }

    fn next_event(&self) -> Cycle {
        let received = if self.hears() {
            self.receiver.next_event(&self.settings)
        } else {
            NEVER
        };
        self.transmitter.next_event().min(received)
    }

    fn interrupt_lines(&self) -> u32 {
        u32::from(self.ris & self.imsc != 0) << self.place.interrupt_line
    }

    /// Transmit asks while the FIFO has room, receive while it holds a character (4.2.5); with
    /// DMAONERR a pending error stops the receive requests.
    fn dma_requests(&self) -> u64 {
        let depth = self.settings.fifo_depth();
        let tx = bit(self.dmacr, DMACR_TXDMAE) && self.enabled(CR_TXE) && self.transmitter.level() < depth;
        let held_by_error = bit(self.dmacr, DMACR_DMAONERR) && self.ris & ERRORS != 0;
        let rx = bit(self.dmacr, DMACR_RXDMAE)
            && self.enabled(CR_RXE)
            && self.receiver.level() > 0
            && !held_by_error;
        u64::from(tx) << self.place.dma_request_tx | u64::from(rx) << self.place.dma_request_rx
    }
}
