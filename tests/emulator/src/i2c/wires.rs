//! SCL and SDA outside the chip: the devices on them, what they hold low, what went over them.

use std::collections::BTreeMap;

use super::super::attached::Attached;
use super::super::circuit::Circuit;
use super::super::clock::Cycle;
use super::device::{Ack, I2cDevice, I2cDirection};

/// What went over the bus from a START to its STOP, RESTARTs included.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct I2cTransaction {
    /// When the START began, and when the STOP was over or arbitration lost.
    pub start: Cycle,
    pub end: Cycle,
    pub address: u8,
    pub written: Vec<u8>,
    pub read: Vec<u8>,
    /// Address and all written bytes were acknowledged.
    pub acked: bool,
}

/// The levels of both lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Levels {
    pub scl: bool,
    pub sda: bool,
}

const IDLE: Levels = Levels { scl: true, sda: true };

#[derive(Clone)]
pub struct Wires {
    devices: Attached<BTreeMap<u8, Box<dyn I2cDevice>>>,
    /// Until then something other than the master holds SCL low.
    scl_free_at: Cycle,
    /// How many clocks of SCL it takes until SDA is released.
    sda_held_for: u32,
    by_hand: Levels,
    under_way: Option<I2cTransaction>,
    log: Vec<I2cTransaction>,
    is_used: bool,
}

impl Default for Wires {
    fn default() -> Self {
        Self {
            devices: Attached::default(),
            scl_free_at: 0,
            sda_held_for: 0,
            by_hand: IDLE,
            under_way: None,
            log: Vec::new(),
            is_used: false,
        }
    }
}

impl Wires {
    pub fn attach(&mut self, address: u8, device: Box<dyn I2cDevice>) {
        assert!(address < 0x80, "{address:#x} is not an I2C address");
        self.devices.get_or_default().insert(address, device);
        self.is_used = true;
    }

    pub fn detach(&mut self, address: u8) {
        if let Some(devices) = self.devices.get_mut() {
            devices.remove(&address);
        }
    }

    pub fn take_log(&mut self) -> Vec<I2cTransaction> {
        std::mem::take(&mut self.log)
    }

    // ----- What the lines are held at ------------------------------------------------------------

    pub fn stretch_until(&mut self, time: Cycle) {
        self.scl_free_at = self.scl_free_at.max(time);
        self.is_used = true;
    }

    pub fn release_scl(&mut self, now: Cycle) {
        self.scl_free_at = self.scl_free_at.min(now);
    }

    pub fn scl_free_at(&self) -> Cycle {
        self.scl_free_at
    }

    pub fn hold_sda(&mut self, clocks: u32) {
        self.sda_held_for = clocks;
        self.is_used = true;
    }

    pub fn sda_is_held(&self) -> bool {
        self.sda_held_for > 0
    }

    /// Clocks have gone by on SCL.
    pub fn clock(&mut self, count: u32) {
        self.sda_held_for = self.sda_held_for.saturating_sub(count);
    }

    pub fn levels(&self, now: Cycle) -> Option<Levels> {
        let levels = Levels {
            scl: self.by_hand.scl && self.scl_free_at <= now,
            sda: self.by_hand.sda && !self.sda_is_held(),
        };
        self.is_used.then_some(levels)
    }

    /// The processor moves the lines through SIO: each rise of SCL is a clock, SDA that rises while
    /// SCL is high a STOP.
    pub fn drive_by_hand(&mut self, driven: Levels, now: Cycle) {
        if driven == self.by_hand {
            return;
        }
        let before = self.levels(now).unwrap_or(IDLE);
        self.by_hand = driven;
        let after = self.levels(now).unwrap_or(IDLE);
        if after.scl && !before.scl {
            self.clock(1);
        }
        if before.scl && after.scl && after.sda && !before.sda {
            self.stop(now);
        }
    }

    /// Shows the circuit to the devices.
    pub fn sense(&mut self, circuit: &Circuit) {
        let devices = self.devices.get_mut();
        for device in devices.into_iter().flat_map(|devices| devices.values_mut()) {
            device.sense(circuit);
        }
    }

    pub fn has_devices(&self) -> bool {
        self.devices.get().is_some()
    }

    // ----- What the master does -------------------------------------------------------------------

    /// START or RESTART, which began at `start`, and an address, which is over at `end`.
    pub fn address(&mut self, address: u8, direction: I2cDirection, start: Cycle, end: Cycle) -> Ack {
        let transaction = self.under_way.get_or_insert_with(|| I2cTransaction {
            start,
            end,
            address,
            written: Vec::new(),
            read: Vec::new(),
            acked: true,
        });
        transaction.address = address;
        let device = self
            .devices
            .get_mut()
            .and_then(|devices| devices.get_mut(&address));
        let ack = device.map_or(Ack::Nack, |device| device.start(direction, end));
        self.after_byte(ack, end)
    }

    pub fn write(&mut self, byte: u8, end: Cycle) -> Ack {
        let ack = self.device().map_or(Ack::Nack, |device| device.write(byte));
        if let Some(transaction) = &mut self.under_way {
            transaction.written.push(byte);
        }
        self.after_byte(ack, end)
    }

    /// A line that no device pulls reads as ones, one that is held as zeros.
    pub fn read(&mut self, end: Cycle) -> u8 {
        let sent = self.device().map_or(0xff, |device| device.read());
        let byte = if self.sda_is_held() { 0 } else { sent };
        if let Some(transaction) = &mut self.under_way {
            transaction.read.push(byte);
        }
        self.after_byte(Ack::Ack, end);
        byte
    }

    /// A STOP, or arbitration was lost: either way the transaction is over.
    pub fn stop(&mut self, now: Cycle) {
        if let Some(device) = self.device() {
            device.stop();
        }
        if let Some(transaction) = self.under_way.take() {
            self.log.push(I2cTransaction {
                end: now,
                ..transaction
            });
        }
    }

    /// A byte did not get through because SDA was held low.
    pub fn lose_arbitration(&mut self, address: u8, clocks: u32, start: Cycle, now: Cycle) {
        self.clock(clocks);
        let transaction = self.under_way.take().unwrap_or(I2cTransaction {
            start,
            end: now,
            address,
            written: Vec::new(),
            read: Vec::new(),
            acked: false,
        });
        self.log.push(I2cTransaction {
            end: now,
            acked: false,
            ..transaction
        });
    }

    fn device(&mut self) -> Option<&mut Box<dyn I2cDevice>> {
        let address = self.under_way.as_ref()?.address;
        self.devices.get_mut()?.get_mut(&address)
    }

    /// SDA that is held low looks like an acknowledgement. Then the device may stretch.
    fn after_byte(&mut self, ack: Ack, end: Cycle) -> Ack {
        let ack = if self.sda_is_held() { Ack::Ack } else { ack };
        self.clock(9);
        if let Some(transaction) = &mut self.under_way {
            transaction.acked &= ack == Ack::Ack;
        }
        let stretch = self.device().map_or(0, |device| device.stretch());
        self.stretch_until(end.saturating_add(stretch));
        ack
    }
}
