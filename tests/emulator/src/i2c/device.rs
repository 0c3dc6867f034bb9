//! What a device on the bus has to answer.

use std::cell::RefCell;
use std::rc::Rc;

use super::super::circuit::Circuit;
use super::super::clock::Cycle;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ack {
    Ack,
    Nack,
}

/// Who sends the bytes after the address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum I2cDirection {
    Write,
    Read,
}

/// A device at an address of its own.
pub trait I2cDevice {
    /// The circuit that the board is part of, if it is one, as it is now. Called before all else, and now and then.
    fn sense(&mut self, _circuit: &Circuit) {}

    /// Its address was sent, after a START or a RESTART, at a moment in emulated time.
    fn start(&mut self, _direction: I2cDirection, _now: Cycle) -> Ack {
        Ack::Ack
    }

    /// The master has sent a byte.
    fn write(&mut self, byte: u8) -> Ack;

    /// The master wants a byte.
    fn read(&mut self) -> u8;

    /// STOP.
    fn stop(&mut self) {}

    /// For how many cycles it holds SCL low, asked after its address and after each byte.
    fn stretch(&mut self) -> Cycle {
        0
    }
}

/// A device a test keeps a hand on after it was attached.
impl<D: I2cDevice> I2cDevice for Rc<RefCell<D>> {
    fn sense(&mut self, circuit: &Circuit) {
        self.borrow_mut().sense(circuit);
    }

    fn start(&mut self, direction: I2cDirection, now: Cycle) -> Ack {
        self.borrow_mut().start(direction, now)
    }

    fn write(&mut self, byte: u8) -> Ack {
        self.borrow_mut().write(byte)
    }

    fn read(&mut self) -> u8 {
        self.borrow_mut().read()
    }

    fn stop(&mut self) {
        self.borrow_mut().stop();
    }

    fn stretch(&mut self) -> Cycle {
        self.borrow_mut().stretch()
    }
}
