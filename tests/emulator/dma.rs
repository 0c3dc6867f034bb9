//! DMA: twelve channels moving data between addresses at the pace of a request (datasheet 2.5).
//!
//! One transfer takes one cycle and all channels share it in turn; FIFOs between read and write,
//! priorities and bus contention are not modelled. Neither are the sniffer and the pacing timers.

use super::bus::Width;
use super::clock::{Cycle, NEVER};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit, field};

pub const CHANNELS: usize = 12;
const CHANNEL_MASK: u32 = (1 << CHANNELS) - 1;
const CHANNEL_STRIDE: u32 = 0x40;

const INTR: u32 = 0x400;
const INTE0: u32 = 0x404;
const INTF0: u32 = 0x408;
const INTS0: u32 = 0x40c;
const INTE1: u32 = 0x414;
const INTF1: u32 = 0x418;
const INTS1: u32 = 0x41c;
const MULTI_CHAN_TRIGGER: u32 = 0x430;
const CHAN_ABORT: u32 = 0x444;
const N_CHANNELS: u32 = 0x448;
/// DMA_IRQ_0 is NVIC line 11, DMA_IRQ_1 line 12.
const INTERRUPT_LINE: u32 = 11;

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

/// The four registers of a channel, each of which occurs once in every alias group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Field {
    ReadAddr,
    WriteAddr,
    TransCount,
    Ctrl,
}

/// The order of the registers in the four alias groups; a write to the last of a group triggers
/// (datasheet 2.5.2.1, Table 121).
const ALIASES: [[Field; 4]; 4] = [
    [Field::ReadAddr, Field::WriteAddr, Field::TransCount, Field::Ctrl],
    [Field::Ctrl, Field::ReadAddr, Field::WriteAddr, Field::TransCount],
    [Field::Ctrl, Field::TransCount, Field::ReadAddr, Field::WriteAddr],
    [Field::Ctrl, Field::WriteAddr, Field::TransCount, Field::ReadAddr],
];

#[derive(Clone, Copy)]
struct Channel {
    read_address: u32,
    write_address: u32,
    /// What TRANS_COUNT starts from at the next trigger.
    reload: u32,
    remaining: u32,
    ctrl: u32,
    errors: u32,
    busy: bool,
}

impl Channel {
    fn new(number: usize) -> Self {
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

    fn width(&self) -> Width {
        match field(self.ctrl, CTRL_DATA_SIZE, 2) {
            0 => Width::Byte,
            1 => Width::Half,
            _ => Width::Word,
        }
    }

    /// Address after a transfer, within its ring if it has one.
    fn stepped(&self, address: u32, increments: bool, is_write: bool) -> u32 {
        if !increments {
            return address;
        }
        let next = address.wrapping_add(self.width() as u32);
        let ring_size = field(self.ctrl, CTRL_RING_SIZE, 4);
        if ring_size == 0 || bit(self.ctrl, CTRL_RING_SEL) != is_write {
            return next;
        }
        let ring = (1 << ring_size) - 1;
        address & !ring | next & ring
    }

    fn swapped(&self, value: u32) -> u32 {
        match self.width() {
            Width::Half if bit(self.ctrl, CTRL_BSWAP) => u32::from((value as u16).swap_bytes()),
            Width::Word if bit(self.ctrl, CTRL_BSWAP) => value.swap_bytes(),
            _ => value,
        }
    }
}

/// One transfer for the bus to carry out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    pub channel: usize,
    pub from: u32,
    pub to: u32,
    pub width: Width,
}

/// How a transfer ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransferEnd {
    Done,
    ReadError,
    WriteError,
}

pub struct Dma {
    channels: [Channel; CHANNELS],
    intr: u32,
    inte: [u32; 2],
    intf: [u32; 2],
    /// The channel that was served last.
    last_served: usize,
    /// The first cycle in which the next transfer can be made.
    free_from: Cycle,
}

impl Dma {
    pub fn new() -> Self {
        Self {
            channels: std::array::from_fn(Channel::new),
            intr: 0,
            inte: [0; 2],
            intf: [0; 2],
            last_served: CHANNELS - 1,
            free_from: 0,
        }
    }

    /// The transfer to be made at `now`, given the requests that are up: the channels take turns.
    pub fn next_transfer(&self, requests: u64, now: Cycle) -> Option<Transfer> {
        if now < self.free_from {
            return None;
        }
        let number = self.next_channel(requests)?;
        let channel = &self.channels[number];
        Some(Transfer {
            channel: number,
            from: channel.read_address,
            to: channel.write_address,
            width: channel.width(),
        })
    }

    /// When the next transfer can be made if the requests stay as they are.
    pub fn next_transfer_time(&self, requests: u64) -> Cycle {
        self.next_channel(requests).map_or(NEVER, |_| self.free_from)
    }

    fn next_channel(&self, requests: u64) -> Option<usize> {
        (1..=CHANNELS)
            .map(|step| (self.last_served + step) % CHANNELS)
            .find(|&number| self.wants_transfer(number, requests))
    }

    /// The data as it goes to the write address.
    pub fn swap(&self, transfer: Transfer, value: u32) -> u32 {
        self.channels[transfer.channel].swapped(value)
    }

    /// The bus has carried out a transfer.
    pub fn complete(&mut self, transfer: Transfer, end: TransferEnd, now: Cycle) {
        self.last_served = transfer.channel;
        self.free_from = now + 1;
        match end {
            TransferEnd::Done => self.step(transfer.channel),
            TransferEnd::ReadError => self.halt(transfer.channel, CTRL_READ_ERROR),
            TransferEnd::WriteError => self.halt(transfer.channel, CTRL_WRITE_ERROR),
        }
    }

    /// "The channel halts when it encounters any bus error, and always raises its channel IRQ
    /// flag" (CTRL.AHB_ERROR).
    fn halt(&mut self, number: usize, error: u32) {
        self.channels[number].errors |= 1 << error;
        self.channels[number].busy = false;
        self.intr |= 1 << number;
    }

    /// A channel is busy; whether it moves depends on its request.
    pub fn is_busy(&self) -> bool {
        self.channels.iter().any(|channel| channel.busy)
    }

    fn wants_transfer(&self, number: usize, requests: u64) -> bool {
        let channel = &self.channels[number];
        let request = field(channel.ctrl, CTRL_TREQ_SEL, 6);
        channel.busy && bit(channel.ctrl, CTRL_EN) && (request == PERMANENT || requests >> request & 1 != 0)
    }

    fn step(&mut self, number: usize) {
        let channel = &mut self.channels[number];
        let (reads_on, writes_on) = (
            bit(channel.ctrl, CTRL_INCR_READ),
            bit(channel.ctrl, CTRL_INCR_WRITE),
        );
        channel.read_address = channel.stepped(channel.read_address, reads_on, false);
        channel.write_address = channel.stepped(channel.write_address, writes_on, true);
        channel.remaining -= 1;
        if channel.remaining == 0 {
            self.finish(number);
        }
    }

    fn finish(&mut self, number: usize) {
        let channel = &mut self.channels[number];
        channel.busy = false;
        if !bit(channel.ctrl, CTRL_IRQ_QUIET) {
            self.intr |= 1 << number;
        }
        let chain_to = field(channel.ctrl, CTRL_CHAIN_TO, 4) as usize;
        if chain_to != number && chain_to < CHANNELS {
            self.trigger(chain_to);
        }
    }

    /// Triggers do nothing to a channel that is disabled or already running (2.5.2.2).
    fn trigger(&mut self, number: usize) {
        let channel = &mut self.channels[number];
        if channel.busy || !bit(channel.ctrl, CTRL_EN) {
            return;
        }
        channel.remaining = channel.reload;
        channel.busy = true;
        if channel.remaining == 0 {
            self.finish(number);
        }
    }

    /// "Writing zero to a trigger register does not start the channel" but, with IRQ_QUIET,
    /// raises its interrupt (null trigger, 2.5.2.3).
    fn written_trigger(&mut self, number: usize, written: u32) {
        if written != 0 {
            self.trigger(number);
        } else if bit(self.channels[number].ctrl, CTRL_IRQ_QUIET) {
            self.intr |= 1 << number;
        }
    }

    fn read_channel(&self, number: usize, register: Field) -> u32 {
        let channel = &self.channels[number];
        match register {
            Field::ReadAddr => channel.read_address,
            Field::WriteAddr => channel.write_address,
            Field::TransCount => channel.remaining,
            Field::Ctrl => channel.control(),
        }
    }

    fn write_channel(&mut self, number: usize, register: Field, write: RegisterWrite) -> u32 {
        let channel = &mut self.channels[number];
        let target = match register {
            Field::ReadAddr => &mut channel.read_address,
            Field::WriteAddr => &mut channel.write_address,
            Field::TransCount => &mut channel.reload,
            Field::Ctrl => {
                channel.errors &= !(write.value & CTRL_ERRORS);
                channel.ctrl = write.applied_to(channel.control()) & CTRL_WRITABLE;
                return channel.ctrl;
            }
        };
        *target = write.applied_to(*target);
        *target
    }

    fn abort(&mut self, channels: u32) {
        for number in 0..CHANNELS {
            if bit(channels, number as u32) {
                self.channels[number].busy = false;
            }
        }
    }

    fn status(&self, line: usize) -> u32 {
        (self.intr & self.inte[line]) | self.intf[line]
    }
}

/// Channel, register and whether a write triggers, for an offset below the common registers.
fn channel_register(offset: u32) -> Option<(usize, Field, bool)> {
    let number = (offset / CHANNEL_STRIDE) as usize;
    let index = (offset % CHANNEL_STRIDE / 4) as usize;
    (number < CHANNELS).then(|| (number, ALIASES[index / 4][index % 4], index % 4 == 3))
}

impl Peripheral for Dma {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        if let Some((number, register, _)) = channel_register(offset) {
            return self.read_channel(number, register);
        }
        match offset {
            INTR => self.intr,
            INTE0 => self.inte[0],
            INTF0 => self.intf[0],
            INTS0 => self.status(0),
            INTE1 => self.inte[1],
            INTF1 => self.intf[1],
            INTS1 => self.status(1),
            N_CHANNELS => CHANNELS as u32,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        if let Some((number, register, triggers)) = channel_register(offset) {
            let written = self.write_channel(number, register, write);
            if triggers {
                self.written_trigger(number, written);
            }
            return;
        }
        match offset {
            INTR | INTS0 | INTS1 => self.intr &= !write.value,
            INTE0 => write.update(&mut self.inte[0], CHANNEL_MASK),
            INTF0 => write.update(&mut self.intf[0], CHANNEL_MASK),
            INTE1 => write.update(&mut self.inte[1], CHANNEL_MASK),
            INTF1 => write.update(&mut self.intf[1], CHANNEL_MASK),
            MULTI_CHAN_TRIGGER => {
                (0..CHANNELS)
                    .filter(|&n| bit(write.value, n as u32))
                    .for_each(|n| self.trigger(n));
            }
            CHAN_ABORT => self.abort(write.value),
            _ => {}
        }
    }

    fn reset(&mut self, _now: Cycle) {
        *self = Self::new();
    }

    fn interrupt_lines(&self) -> u32 {
        (0..2)
            .map(|line| u32::from(self.status(line) != 0) << (INTERRUPT_LINE + line as u32))
            .sum()
    }
}
