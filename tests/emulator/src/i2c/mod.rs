//! I2C0 and I2C1: DW_apb_i2c (datasheet 4.3) as a master, each with the bus at its pins.
//!
//! Modelled: both 16-deep FIFOs, START, RESTART and STOP as the commands ask for them, the time every
//! bit takes, clock stretching, aborts after a missing acknowledgement and after lost arbitration,
//! interrupts, DMA requests, and bus recovery by hand through SIO. Not modelled, and a panic: slave
//! mode, 10-bit addresses, general call and START byte, RESTART disabled, the abort bit of IC_ENABLE.
//! The bus has pull-ups of its own.

mod device;
pub mod devices;
mod master;
mod registers;
mod speed;
#[cfg(test)]
mod tests;
mod wires;
#[cfg(test)]
mod wires_tests;

use super::circuit::Circuit;
use super::clock::{Cycle, NEVER};
pub use device::{Ack, I2cDevice, I2cDirection};
use master::Master;
use registers::Settings;
use wires::Wires;
pub use wires::{I2cTransaction, Levels};

/// Where an I2C block is on the chip.
#[derive(Clone, Copy)]
pub struct I2cPlace {
    pub interrupt_line: u32,
    pub dma_request_tx: u32,
    pub dma_request_rx: u32,
}

#[derive(Clone)]
pub struct I2c {
    place: I2cPlace,
    wires: Wires,
    master: Master,
    settings: Settings,
    /// The pins of the bus lead to this block.
    connected: bool,
    now: Cycle,
}

impl I2c {
    pub fn new(place: I2cPlace) -> Self {
        Self {
            place,
            wires: Wires::default(),
            master: Master::default(),
            settings: Settings::default(),
            connected: false,
            now: 0,
        }
    }

    /// Put a device on the bus. What was at this address is gone.
    pub fn attach(&mut self, address: u8, device: Box<dyn I2cDevice>) {
        self.wires.attach(address, device);
    }

    /// Take whatever is at this address off the bus: it is not acknowledged any more.
    pub fn detach(&mut self, address: u8) {
        self.wires.detach(address);
    }

    /// Shows its devices the circuit that the board is part of.
    pub fn sense(&mut self, circuit: &Circuit) {
        self.wires.sense(circuit);
    }

    pub fn has_devices(&self) -> bool {
        self.wires.has_devices()
    }

    /// Hold SCL low from now on.
    pub fn hold_scl(&mut self) {
        self.wires.stretch_until(NEVER);
        self.master.pause(self.now);
    }

    /// Let go of SCL.
    pub fn release_scl(&mut self) {
        self.wires.release_scl(self.now);
    }

    /// Hold SDA low from now on, until this many clocks have gone by on SCL.
    pub fn hold_sda(&mut self, until_clocks: u32) {
        self.wires.hold_sda(until_clocks);
    }

    /// Let go of SDA. SCL is high, so what the chip sees is a STOP.
    pub fn release_sda(&mut self) {
        if self.wires.sda_is_held() {
            self.wires.hold_sda(0);
            self.master.note_stop_seen();
        }
    }

    /// Take the transactions that are over, oldest first.
    pub fn take_transactions(&mut self) -> Vec<I2cTransaction> {
        self.wires.take_log()
    }

    /// Whether the pins of the bus lead to this block.
    pub fn connect(&mut self, connected: bool, now: Cycle) {
        if connected == self.connected {
            return;
        }
        self.advance_to(now);
        self.connected = connected;
        if connected {
            self.master.resume(now);
            self.advance_to(now);
        } else {
            self.master.pause(now);
        }
    }

    /// What the processor makes of the lines by hand: `true` where it leaves one to its pull-up.
    pub fn drive_by_hand(&mut self, driven: Levels) {
        self.wires.drive_by_hand(driven, self.now);
    }

    /// The lines as they are read at the pins; `None` when there is no bus at all.
    pub fn levels(&self, now: Cycle) -> Option<Levels> {
        self.wires.levels(now)
    }

    fn advance_to(&mut self, now: Cycle) {
        self.now = now;
        if self.connected {
            self.master.advance(now, &self.settings, &mut self.wires);
        }
    }
}
