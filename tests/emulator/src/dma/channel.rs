//! One DMA channel: its registers, and where its next transfer goes.

use super::super::bus::Width;
use super::super::memory::{RAM_BASE, RAM_SIZE};
use super::super::register::{RegisterWrite, bit, field};

const CTRL_EN: u32 = 0;
const CTRL_DATA_SIZE: u32 = 2;
const CTRL_INCR_READ: u32 = 4;
const CTRL_INCR_WRITE: u32 = 5;
const CTRL_RING_SIZE: u32 = 6;
const CTRL_RING_SEL: u32 = 10;
const CTRL_CHAIN_TO: u32 = 11;
const CTRL_TREQ_SEL: u32 = 15;
const CTRL_IRQ_QUIET: u32 = 21;
const CTRL_BSWAP: u32 = 22;
const CTRL_BUSY: u32 = 24;
const CTRL_WRITE_ERROR: u32 = 29;
const CTRL_READ_ERROR: u32 = 30;
const CTRL_AHB_ERROR: u32 = 31;
const CTRL_WRITABLE: u32 = 0x00ff_ffff;
const CTRL_ERRORS: u32 = 1 << CTRL_WRITE_ERROR | 1 << CTRL_READ_ERROR;
/// TREQ_SEL of an unpaced transfer.
const PERMANENT: u32 = 0x3f;
const RAM_END: u32 = RAM_BASE + RAM_SIZE as u32;

/// The four registers of a channel, each of which occurs once in every alias group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    ReadAddr,
    WriteAddr,
    TransCount,
    Ctrl,
}

/// The order of the registers in the four alias groups; a write to the last of a group triggers
/// (datasheet 2.5.2.1).
pub const ALIASES: [[Field; 4]; 4] = [
    [Field::ReadAddr, Field::WriteAddr, Field::TransCount, Field::Ctrl],
    [Field::Ctrl, Field::ReadAddr, Field::WriteAddr, Field::TransCount],
    [Field::Ctrl, Field::TransCount, Field::ReadAddr, Field::WriteAddr],
    [Field::Ctrl, Field::WriteAddr, Field::TransCount, Field::ReadAddr],
];

/// The failure of a transfer: an error flag of CTRL, by its bit number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransferError {
    Write = CTRL_WRITE_ERROR as isize,
    Read = CTRL_READ_ERROR as isize,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Read,
    Write,
}

#[derive(Clone, Copy)]
pub struct Channel {
    pub read_address: u32,
    pub write_address: u32,
    /// What TRANS_COUNT starts from at the next trigger.
    reload: u32,
    remaining: u32,
    ctrl: u32,
    errors: u32,
    pub busy: bool,
}

impl Channel {
    pub fn new(number: usize) -> Self {
        Self {
            read_address: 0,
            write_address: 0,
            reload: 0,
            remaining: 0,
            // CHAIN_TO is the channel itself after reset, which means no chaining.
            ctrl: (number as u32) << CTRL_CHAIN_TO,
            errors: 0,
            busy: false,
        }
    }

    fn control(&self) -> u32 {
        let any_error = self.errors != 0;
        self.ctrl | self.errors | u32::from(self.busy) << CTRL_BUSY | u32::from(any_error) << CTRL_AHB_ERROR
    }

    pub fn width(&self) -> Width {
        match field(self.ctrl, CTRL_DATA_SIZE, 2) {
            0 => Width::Byte,
            1 => Width::Half,
            _ => Width::Word,
        }
    }

    /// Address after a transfer, within its ring if it has one.
    fn stepped(&self, address: u32, increment: u32, side: Side) -> u32 {
        if !bit(self.ctrl, increment) {
            return address;
        }
        let next = address.wrapping_add(self.width() as u32);
        match self.ring(side) {
            Some(ring) => address & !ring | next & ring,
            None => next,
        }
    }

    /// The bits of an address that change within its ring, if it has one.
    fn ring(&self, side: Side) -> Option<u32> {
        let ring_size = field(self.ctrl, CTRL_RING_SIZE, 4);
        let ring_side = if bit(self.ctrl, CTRL_RING_SEL) {
            Side::Write
        } else {
            Side::Read
        };
        (ring_size != 0 && ring_side == side).then_some((1 << ring_size) - 1)
    }

    /// Whether all that it reads comes from one register.
    pub fn reads_only(&self, register: u32) -> bool {
        self.read_address == register && !bit(self.ctrl, CTRL_INCR_READ)
    }

    /// Whether all that it reads is in RAM.
    pub fn reads_ram(&self) -> bool {
        self.stays_in_ram(self.read_address, CTRL_INCR_READ, Side::Read)
    }

    /// Whether all that it writes is in RAM.
    pub fn writes_ram(&self) -> bool {
        self.stays_in_ram(self.write_address, CTRL_INCR_WRITE, Side::Write)
    }

    fn stays_in_ram(&self, address: u32, increment: u32, side: Side) -> bool {
        let transfers = if bit(self.ctrl, increment) {
            self.remaining.max(self.reload)
        } else {
            1
        };
        let bytes = transfers.saturating_mul(self.width() as u32);
        let (first, end) = match self.ring(side) {
            Some(ring) => (address & !ring, (address | ring).saturating_add(1)),
            None => (address, address.saturating_add(bytes)),
        };
        RAM_BASE <= first && end <= RAM_END
    }

    /// The only address it writes, if that is one.
    pub fn only_target(&self) -> Option<u32> {
        (!bit(self.ctrl, CTRL_INCR_WRITE)).then_some(self.write_address)
    }

    pub fn is_enabled(&self) -> bool {
        bit(self.ctrl, CTRL_EN)
    }

    /// With IRQ_QUIET the end of a transfer sequence raises no interrupt.
    pub fn is_quiet(&self) -> bool {
        bit(self.ctrl, CTRL_IRQ_QUIET)
    }

    /// The channel to start when this one has finished; itself for none.
    pub fn chain_to(&self) -> usize {
        field(self.ctrl, CTRL_CHAIN_TO, 4) as usize
    }

    /// Whether it can make a transfer while these requests are up.
    pub fn wants_transfer(&self, requests: u64) -> bool {
        let request = self.request();
        self.busy && self.is_enabled() && (request == PERMANENT || requests >> request & 1 != 0)
    }

    /// The number of the request that paces it.
    pub fn request(&self) -> u32 {
        field(self.ctrl, CTRL_TREQ_SEL, 6)
    }

    pub fn is_unpaced(&self) -> bool {
        self.request() == PERMANENT
    }

    /// Start a sequence of TRANS_COUNT transfers.
    pub fn start(&mut self) {
        self.remaining = self.reload;
        self.busy = true;
    }

    /// Move on after a transfer.
    pub fn step(&mut self) {
        self.read_address = self.stepped(self.read_address, CTRL_INCR_READ, Side::Read);
        self.write_address = self.stepped(self.write_address, CTRL_INCR_WRITE, Side::Write);
        self.remaining -= 1;
    }

    pub fn is_done(&self) -> bool {
        self.remaining == 0
    }

    /// Stop with one of the error flags.
    pub fn halt(&mut self, error: TransferError) {
        self.errors |= 1 << error as u32;
        self.busy = false;
    }

    pub fn read(&self, register: Field) -> u32 {
        match register {
            Field::ReadAddr => self.read_address,
            Field::WriteAddr => self.write_address,
            Field::TransCount => self.remaining,
            Field::Ctrl => self.control(),
        }
    }

    /// Returns what the register holds afterwards.
    pub fn write(&mut self, register: Field, write: RegisterWrite) -> u32 {
        let target = match register {
            Field::ReadAddr => &mut self.read_address,
            Field::WriteAddr => &mut self.write_address,
            Field::TransCount => &mut self.reload,
            Field::Ctrl => {
                self.errors &= !(write.value & CTRL_ERRORS);
                self.ctrl = write.applied_to(self.control()) & CTRL_WRITABLE;
                assert!(!bit(self.ctrl, CTRL_BSWAP), "DMA: CTRL.BSWAP is not modelled");
                return self.ctrl;
            }
        };
        *target = write.applied_to(*target);
        *target
    }
}
