//! MCP2515: a CAN controller behind SPI (Microchip DS20001801J), with a transceiver at a bus.
//!
//! Modelled: all instructions but RX STATUS (table 12-1), the register map (tables 11-1 and 11-2) with what can be written when,
//! normal and configuration mode and their changes (10), bit timing (5), both receive buffers with their filters and rollover
//! (4), the transmit buffers with priorities and abortion (3), error counters and flags (6, 7.6), the interrupt output. Not
//! modelled, and a panic: the other modes, ABAT and OSM. Left out: the pins RXnBF, TXnRTS and CLKOUT, and remote frames. What
//! the data sheet leaves unknown after a reset is garbage.
//! That the mode changes from configuration only after 11 recessive bits is how CAN controllers join a bus; the data sheet only
//! requires to read the mode back (10).

mod acceptance;
mod controller;
mod registers;
#[cfg(test)]
mod tests;
mod timing;

use std::cell::{Ref, RefCell, RefMut};
use std::rc::Rc;

use super::super::super::can::{ErrorState, SharedCanBus};
use super::super::super::clock::Cycle;
use super::super::device::{SpiClock, SpiDevice, SpiMode};
use controller::Controller;
pub use registers::*;

/// Table 13-6: FCLK.
const MAX_HZ: u64 = 10_000_000;

/// Instructions, of table 12-1.
const RESET: u8 = 0b1100_0000;
const READ: u8 = 0b0000_0011;
const WRITE: u8 = 0b0000_0010;
const BIT_MODIFY: u8 = 0b0000_0101;
const READ_RX_BUFFER: u8 = 0b1001_0000;
const LOAD_TX_BUFFER: u8 = 0b0100_0000;
const REQUEST_TO_SEND: u8 = 0b1000_0000;
const READ_STATUS: u8 = 0b1010_0000;

/// What the bytes since the select have led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    Instruction,
    ReadAddress,
    WriteAddress,
    ModifyAddress,
    ModifyMask(u8),
    ModifyData(u8, u8),
    Reading(u8),
    /// The flag of this receive buffer is cleared at the end.
    ReadingBuffer(u8, usize),
    Writing(u8),
    Status,
    /// Further bytes mean nothing.
    Done,
}

pub struct Mcp2515 {
    controller: Rc<RefCell<Controller>>,
    bus: SharedCanBus,
    transfer: Transfer,
    /// The last bit of the byte before, which a wrong clock shifts into the next.
    last_bit: u8,
    is_powered: bool,
}

impl Mcp2515 {
    /// A controller with a crystal, at a bus.
    pub fn new(crystal_hz: u64, bus: SharedCanBus) -> Self {
        let controller = Rc::new(RefCell::new(Controller::new(crystal_hz)));
        bus.borrow_mut().attach(controller.clone());
        Self {
            controller,
            bus,
            transfer: Transfer::Instruction,
            last_bit: 0,
            is_powered: true,
        }
    }

    /// Takes its supply away, or gives it back.
    pub fn set_powered(&mut self, is_powered: bool) {
        self.is_powered = is_powered;
        self.controller_mut().power(is_powered);
    }

    /// It resets itself, as a dip of its supply makes it.
    pub fn reset(&mut self) {
        self.controller_mut().reset();
    }

    /// A register as an instruction would read it.
    pub fn register(&self, address: u8) -> u8 {
        self.controller().read(address)
    }

    /// How it stands with the bus.
    pub fn error_state(&self) -> ErrorState {
        use super::super::super::can::CanNode;
        self.controller().confinement().state()
    }

    /// The bit rate that is set up, in bits per second; `None` if the segments are not allowed.
    pub fn bits_per_second(&self) -> Option<u64> {
        self.controller().timing().bits_per_second()
    }

    /// Frames that passed the filters and found no buffer.
    pub fn lost_frames(&self) -> u64 {
        self.controller().lost
    }

    /// Writes to a transmit buffer while it was being sent, or to registers that only configuration mode opens.
    pub fn ignored_writes(&self) -> u64 {
        self.controller().ignored_writes
    }

    fn controller(&self) -> Ref<'_, Controller> {
        self.controller.borrow()
    }

    fn controller_mut(&self) -> RefMut<'_, Controller> {
        self.controller.borrow_mut()
    }

    fn obey(&mut self, byte: u8) -> Option<u8> {
        let (next, answer) = match self.transfer {
            Transfer::Instruction => (self.begin(byte), None),
            Transfer::ReadAddress => (Transfer::Reading(byte & 0x7f), None),
            Transfer::WriteAddress => (Transfer::Writing(byte & 0x7f), None),
            Transfer::ModifyAddress => (Transfer::ModifyMask(byte & 0x7f), None),
            Transfer::ModifyMask(address) => (Transfer::ModifyData(address, byte), None),
            Transfer::ModifyData(address, mask) => {
                self.controller_mut().modify(address, mask, byte);
                (Transfer::Done, None)
            }
            Transfer::Reading(address) => (
                Transfer::Reading(following(address)),
                Some(self.register(address)),
            ),
            Transfer::ReadingBuffer(address, buffer) => {
                let next = Transfer::ReadingBuffer(following(address), buffer);
                (next, Some(self.register(address)))
            }
            Transfer::Writing(address) => {
                self.controller_mut().write(address, byte);
                (Transfer::Writing(following(address)), None)
            }
            Transfer::Status => (Transfer::Status, Some(self.controller().read_status())),
            Transfer::Done => (Transfer::Done, None),
        };
        self.transfer = next;
        answer
    }

    fn begin(&mut self, instruction: u8) -> Transfer {
        match instruction {
            RESET => {
                self.controller_mut().reset();
                Transfer::Done
            }
            READ => Transfer::ReadAddress,
            WRITE => Transfer::WriteAddress,
            BIT_MODIFY => Transfer::ModifyAddress,
            READ_STATUS => Transfer::Status,
            _ if instruction & 0xf9 == READ_RX_BUFFER => self.begin_buffer(instruction >> 1 & 0b11),
            _ if instruction & 0xf8 == LOAD_TX_BUFFER => load_tx_buffer(instruction & 0b111),
            _ if instruction & 0xf8 == REQUEST_TO_SEND => {
                self.controller_mut().request_to_send(instruction & 0b111);
                Transfer::Done
            }
            _ => Transfer::Done,
        }
    }

    /// Figure 12-3: both buffers, from the identifier or from the data on.
    fn begin_buffer(&self, which: u8) -> Transfer {
        let buffer = usize::from(which >> 1);
        let first = RXB_CTRL[buffer] + if which & 1 == 0 { 1 } else { 6 };
        Transfer::ReadingBuffer(first, buffer)
    }
}

/// Figure 12-5.
fn load_tx_buffer(which: u8) -> Transfer {
    match TXB_CTRL.get(usize::from(which >> 1)) {
        Some(control) => Transfer::Writing(control + if which & 1 == 0 { 1 } else { 6 }),
        None => Transfer::Done,
    }
}

fn following(address: u8) -> u8 {
    (address + 1) & 0x7f
}

impl SpiDevice for Mcp2515 {
    fn select(&mut self) {
        self.transfer = Transfer::Instruction;
        self.last_bit = 0;
    }

    fn deselect(&mut self) {
        if let Transfer::ReadingBuffer(_, buffer) = self.transfer {
            self.controller_mut().release(buffer);
        }
        self.transfer = Transfer::Instruction;
    }

    /// Modes 0,0 and 1,1. With the other edges it takes each bit one clock late, and what it sends is a bit late, too. During the start of its
    /// oscillator it does not answer.
    fn exchange(&mut self, byte: u8, clock: SpiClock) -> Option<u8> {
        if !self.is_powered || clock.hz > MAX_HZ || self.controller().is_starting() {
            return None;
        }
        if matches!(clock.mode, SpiMode::Mode0 | SpiMode::Mode3) {
            return self.obey(byte);
        }
        let late = byte >> 1 | self.last_bit << 7;
        self.last_bit = byte & 1;
        self.obey(late).map(|answer| answer >> 1)
    }

    fn advance(&mut self, now: Cycle) {
        self.controller_mut().pass_time(now);
        self.bus.borrow_mut().advance(now);
    }

    fn next_event(&self) -> Cycle {
        self.bus.borrow().next_event()
    }

    fn interrupt_level(&self) -> Option<bool> {
        self.is_powered.then(|| !self.controller().interrupts())
    }
}
