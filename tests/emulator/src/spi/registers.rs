//! The registers of an SPI block (datasheet 4.4.4).

use super::super::clock::{CLK_SYS_HZ, Cycle};
use super::super::peripheral::Peripheral;
use super::super::register::{RegisterWrite, bit, field};
use super::device::{SpiClock, SpiMode};
use super::{FIFO_DEPTH, ROR, Spi};

pub const SSPCR0: u32 = 0x00;
pub const SSPCR1: u32 = 0x04;
pub const SSPDR: u32 = 0x08;
pub const SSPSR: u32 = 0x0c;
pub const SSPCPSR: u32 = 0x10;
pub const SSPIMSC: u32 = 0x14;
pub const SSPRIS: u32 = 0x18;
pub const SSPMIS: u32 = 0x1c;
pub const SSPICR: u32 = 0x20;
pub const SSPDMACR: u32 = 0x24;
const IDENTIFICATION: [(u32, u32); 8] = [
    (0xfe0, 0x22),
    (0xfe4, 0x10),
    (0xfe8, 0x34),
    (0xfec, 0x00),
    (0xff0, 0x0d),
    (0xff4, 0xf0),
    (0xff8, 0x05),
    (0xffc, 0xb1),
];

/// SSPCR0: data size less one, frame format, polarity, phase, clock rate.
const DSS_8_BITS: u32 = 7;
const SPO: u32 = 6;
const SPH: u32 = 7;
const SCR: u32 = 8;
/// SSPCR1: loopback, enable, slave.
const SSE: u32 = 1;
const LOOPBACK_OR_SLAVE: u32 = 0b101;
const RECEIVE_TIMEOUT: u32 = 1 << 1;
const DMACR_RX: u32 = 0;
const DMACR_TX: u32 = 1;
const BITS: u64 = 8;

#[derive(Clone, Copy, Debug, Default)]
pub struct Settings {
    cr0: u32,
    cr1: u32,
    prescaler: u32,
    imsc: u32,
    dmacr: u32,
}

impl Settings {
    pub fn is_enabled(self) -> bool {
        bit(self.cr1, SSE)
    }

    /// SSPCLK / (CPSDVSR x (1 + SCR)), CPSDVSR even and 2 at least (4.4.3.4).
    fn bit_cycles(self) -> Cycle {
        u64::from(self.prescaler) * (1 + u64::from(field(self.cr0, SCR, 8)))
    }

    pub fn frame(self) -> Cycle {
        BITS * self.bit_cycles()
    }

    pub fn clock(self) -> SpiClock {
        SpiClock {
            mode: match (bit(self.cr0, SPO), bit(self.cr0, SPH)) {
                (false, false) => SpiMode::Mode0,
                (false, true) => SpiMode::Mode1,
                (true, false) => SpiMode::Mode2,
                (true, true) => SpiMode::Mode3,
            },
            hz: CLK_SYS_HZ / self.bit_cycles(),
        }
    }

    /// Misuse, and what is not modelled.
    fn check(self) {
        if !self.is_enabled() {
            return;
        }
        assert!(
            field(self.cr0, 0, 6) == DSS_8_BITS && self.cr1 & LOOPBACK_OR_SLAVE == 0,
            "SPI is modelled as a master in Motorola's format with eight bits: SSPCR0 {:#x}, SSPCR1 {:#x}",
            self.cr0,
            self.cr1
        );
        assert!(
            self.prescaler >= 2,
            "SPI is enabled with SSPCPSR {}",
            self.prescaler
        );
    }
}

impl Spi {
    fn status(&self) -> u32 {
        let (tx, rx) = (self.transmit.len(), self.receive.len());
        u32::from(tx == 0)
            | u32::from(tx < FIFO_DEPTH) << 1
            | u32::from(rx > 0) << 2
            | u32::from(rx == FIFO_DEPTH) << 3
            | u32::from(self.is_busy()) << 4
    }
}

impl Peripheral for Spi {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            SSPCR0 => self.settings.cr0,
            SSPCR1 => self.settings.cr1,
            SSPDR => self.pop(),
            SSPSR => self.status(),
            SSPCPSR => self.settings.prescaler,
            SSPIMSC => self.settings.imsc,
            SSPRIS => self.raw_interrupts(),
            SSPMIS => self.raw_interrupts() & self.settings.imsc,
            SSPDMACR => self.settings.dmacr,
            _ => IDENTIFICATION
                .iter()
                .find(|id| id.0 == offset)
                .map_or(0, |id| id.1),
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        match offset {
            SSPCR0 => write.update(&mut self.settings.cr0, 0xffff),
            SSPCR1 => write.update(&mut self.settings.cr1, 0xf),
            SSPDR => self.push(write.value as u8, now),
            // "Bit 0 always returns zero on reads" (SSPCPSR).
            SSPCPSR => write.update(&mut self.settings.prescaler, 0xfe),
            SSPIMSC => {
                write.update(&mut self.settings.imsc, 0xf);
                let waits = self.settings.imsc & RECEIVE_TIMEOUT != 0;
                assert!(!waits, "the receive timeout of SPI is not modelled");
            }
            SSPICR if write.value & ROR != 0 => self.overrun = false,
            SSPDMACR => write.update(&mut self.settings.dmacr, 0b11),
            _ => {}
        }
        self.settings.check();
    }

    /// The devices, and which of them are selected, stay.
    fn reset(&mut self, _now: Cycle) {
        *self = Self {
            pins: self.pins,
            wires: std::mem::take(&mut self.wires),
            ..Self::new(self.place)
        };
    }

    fn advance(&mut self, now: Cycle) {
        self.advance_to(now);
    }

    fn next_event(&self) -> Cycle {
        self.next_end()
    }

    fn interrupt_lines(&self) -> u32 {
        u32::from(self.raw_interrupts() & self.settings.imsc != 0) << self.place.interrupt_line
    }

    /// Transmit asks while the FIFO has room, receive while it holds a byte; neither while the block is
    /// disabled (PL022 TRM, 2.5).
    fn dma_requests(&self) -> u64 {
        if !self.settings.is_enabled() {
            return 0;
        }
        let tx = bit(self.settings.dmacr, DMACR_TX) && self.transmit.len() < FIFO_DEPTH;
        let rx = bit(self.settings.dmacr, DMACR_RX) && !self.receive.is_empty();
        u64::from(tx) << self.place.dma_request_tx | u64::from(rx) << self.place.dma_request_rx
    }
}
