//! What a device on the bus has to answer.

use std::cell::RefCell;
use std::rc::Rc;

use super::super::clock::{Cycle, NEVER};

/// Clock polarity and phase: the level of SCK at rest, and the edge at which both sides sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpiMode {
    /// Low at rest, sampled at the rising edge.
    Mode0,
    /// Low at rest, sampled at the falling edge.
    Mode1,
    /// High at rest, sampled at the falling edge.
    Mode2,
    /// High at rest, sampled at the rising edge.
    Mode3,
}

/// The clock a byte comes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpiClock {
    pub mode: SpiMode,
    pub hz: u64,
}

/// A device with a select line of its own.
pub trait SpiDevice {
    /// Its select line has gone low.
    fn select(&mut self) {}

    /// Its select line has gone high.
    fn deselect(&mut self) {}

    /// A byte each way, at the same time. Only called while it is selected. `None`: it does not drive
    /// the line.
    fn exchange(&mut self, byte: u8, clock: SpiClock) -> Option<u8>;

    /// Everything that is due up to and including `now` happens. Called before all of the above.
    fn advance(&mut self, _now: Cycle) {}

    /// When [`Self::advance`] is needed next.
    fn next_event(&self) -> Cycle {
        NEVER
    }

    /// The level of its interrupt output; `None` while it does not drive it.
    fn interrupt_level(&self) -> Option<bool> {
        None
    }
}

/// A device a test keeps a hand on after it was attached.
impl<D: SpiDevice> SpiDevice for Rc<RefCell<D>> {
    fn select(&mut self) {
        self.borrow_mut().select();
    }

    fn deselect(&mut self) {
        self.borrow_mut().deselect();
    }

    fn exchange(&mut self, byte: u8, clock: SpiClock) -> Option<u8> {
        self.borrow_mut().exchange(byte, clock)
    }

    fn advance(&mut self, now: Cycle) {
        self.borrow_mut().advance(now);
    }

    fn next_event(&self) -> Cycle {
        self.borrow().next_event()
    }

    fn interrupt_level(&self) -> Option<bool> {
        self.borrow().interrupt_level()
    }
}
