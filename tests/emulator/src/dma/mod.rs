//! DMA: twelve channels moving data between addresses at the pace of a request (datasheet 2.5).
//!
//! One transfer takes one cycle and all channels share it in turn; FIFOs between read and write,
//! priorities and bus contention are not modelled. Neither are the sniffer and the pacing timers. Byte swaps,
//! the second interrupt, forced ones and triggers of several channels are a panic.

mod channel;
mod stream;
#[cfg(test)]
mod tests;

use super::bus::Width;
use super::clock::{Cycle, NEVER};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit};
pub use channel::TransferError;
use channel::{ALIASES, Channel, Field};
pub use stream::ConverterStream;

pub const CHANNELS: usize = 12;
pub const CHANNEL_MASK: u32 = (1 << CHANNELS) - 1;
const CHANNEL_STRIDE: u32 = 0x40;

const INTR: u32 = 0x400;
const INTE0: u32 = 0x404;
const INTF0: u32 = 0x408;
const INTS0: u32 = 0x40c;
const INTE1: u32 = 0x414;
const INTF1: u32 = 0x418;
const MULTI_CHAN_TRIGGER: u32 = 0x430;
const CHAN_ABORT: u32 = 0x444;
const N_CHANNELS: u32 = 0x448;
/// DMA_IRQ_0.
const INTERRUPT_LINE: u32 = 11;

/// One transfer for the bus to carry out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    pub channel: usize,
    pub from: u32,
    pub to: u32,
    pub width: Width,
}

#[derive(Clone)]
pub struct Dma {
    channels: [Channel; CHANNELS],
    intr: u32,
    inte: u32,
    /// The channel that was served last.
    last_served: usize,
    /// The first cycle in which the next transfer can be made.
    free_from: Cycle,
    faults: Faults,
    /// As the channels are set.
    stream: ConverterStream,
}

/// Faults that a test puts in.
#[derive(Clone, Copy, Default)]
struct Faults {
    /// No transfer is made.
    is_held: bool,
    /// The channels whose next transfer ends in a bus error.
    failing: u32,
}

impl Dma {
    pub fn new() -> Self {
        Self {
            channels: std::array::from_fn(Channel::new),
            intr: 0,
            inte: 0,
            last_served: CHANNELS - 1,
            free_from: 0,
            faults: Faults::default(),
            stream: ConverterStream::NONE,
        }
    }

    /// Makes no transfers until [`Self::release`].
    pub fn hold(&mut self) {
        self.faults.is_held = true;
    }

    pub fn release(&mut self) {
        self.faults.is_held = false;
    }

    /// Has the next transfer of a channel end in a bus error.
    pub fn fail_transfer(&mut self, channel: usize) {
        assert!(channel < CHANNELS, "the RP2040 has no DMA channel {channel}");
        self.faults.failing |= 1 << channel;
        self.stream = ConverterStream::of(self);
    }

    /// Whether a transfer of this channel is to fail.
    pub fn take_failure(&mut self, channel: usize) -> bool {
        let fails = bit(self.faults.failing, channel as u32);
        if fails {
            self.faults.failing &= !(1 << channel);
            self.stream = ConverterStream::of(self);
        }
        fails
    }

    /// The channels that bring results of the converter into RAM.
    pub fn stream(&self) -> ConverterStream {
        self.stream
    }

    /// The transfer to be made at `now` by one of these channels, given the requests that are up: the channels take turns.
    pub fn next_transfer(&self, channels: u32, requests: u64, now: Cycle) -> Option<Transfer> {
        if now < self.free_from {
            return None;
        }
        let number = self.next_channel(channels, requests)?;
        let channel = &self.channels[number];
        Some(Transfer {
            channel: number,
            from: channel.read_address,
            to: channel.write_address,
            width: channel.width(),
        })
    }

    /// When the next transfer of these channels can be made if the requests stay as they are.
    pub fn next_transfer_time(&self, channels: u32, requests: u64) -> Cycle {
        self.next_channel(channels, requests)
            .map_or(NEVER, |_| self.free_from)
    }

    fn next_channel(&self, channels: u32, requests: u64) -> Option<usize> {
        if self.faults.is_held {
            return None;
        }
        let after_last_served = u32::MAX << (self.last_served + 1);
        numbers(channels & after_last_served)
            .chain(numbers(channels & !after_last_served))
            .find(|&number| self.channels[number].wants_transfer(requests))
    }

    /// The bus has carried out a transfer.
    pub fn complete(&mut self, transfer: Transfer, end: Result<(), TransferError>, now: Cycle) {
        self.last_served = transfer.channel;
        self.free_from = now + 1;
        match end {
            Ok(()) => self.step(transfer.channel),
            Err(error) => self.halt(transfer.channel, error),
        }
    }

    /// "The channel halts when it encounters any bus error, and always raises its channel IRQ
    /// flag" (CTRL.AHB_ERROR).
    fn halt(&mut self, number: usize, error: TransferError) {
        self.channels[number].halt(error);
        self.intr |= 1 << number;
    }

    /// One of these channels is busy; whether it moves depends on its request.
    pub fn is_busy(&self, channels: u32) -> bool {
        numbers(channels).any(|number| self.channels[number].busy)
    }

    fn step(&mut self, number: usize) {
        self.channels[number].step();
        if self.channels[number].is_done() {
            self.finish(number);
        }
    }

    fn finish(&mut self, number: usize) {
        let channel = &mut self.channels[number];
        channel.busy = false;
        let (quiet, chain_to) = (channel.is_quiet(), channel.chain_to());
        if !quiet {
            self.intr |= 1 << number;
        }
        if chain_to != number && chain_to < CHANNELS {
            self.trigger(chain_to);
        }
    }

    /// Triggers do nothing to a channel that is disabled or already running (2.5.2.2).
    fn trigger(&mut self, number: usize) {
        let channel = &mut self.channels[number];
        if channel.busy || !channel.is_enabled() {
            return;
        }
        channel.start();
        if channel.is_done() {
            self.finish(number);
        }
        self.stream = ConverterStream::of(self);
    }

    /// A zero written to a trigger register starts nothing; with IRQ_QUIET it raises the interrupt
    /// of the channel (null trigger, 2.5.2.3).
    fn written_trigger(&mut self, number: usize, written: u32) {
        if written != 0 {
            self.trigger(number);
        } else if self.channels[number].is_quiet() {
            self.intr |= 1 << number;
        }
    }

    fn abort(&mut self, channels: u32) {
        for number in 0..CHANNELS {
            if bit(channels, number as u32) {
                self.channels[number].busy = false;
            }
        }
    }

    fn write_common(&mut self, offset: u32, write: RegisterWrite) {
        match offset {
            INTR | INTS0 => self.intr &= !write.value,
            INTE0 => write.update(&mut self.inte, CHANNEL_MASK),
            INTF0 | INTE1 | INTF1 | MULTI_CHAN_TRIGGER => {
                panic!("DMA: the register at {offset:#x} is not modelled")
            }
            CHAN_ABORT => self.abort(write.value),
            _ => {}
        }
    }

    fn status(&self) -> u32 {
        self.intr & self.inte
    }
}

/// The numbers of these channels, in order.
fn numbers(mut channels: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = channels.trailing_zeros();
        channels &= channels.wrapping_sub(1);
        (lowest < u32::BITS).then_some(lowest as usize)
    })
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
            return self.channels[number].read(register);
        }
        match offset {
            INTR => self.intr,
            INTE0 => self.inte,
            INTS0 => self.status(),
            N_CHANNELS => CHANNELS as u32,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        if let Some((number, register, triggers)) = channel_register(offset) {
            let written = self.channels[number].write(register, write);
            if triggers {
                self.written_trigger(number, written);
            }
        } else {
            self.write_common(offset, write);
        }
        self.stream = ConverterStream::of(self);
    }

    fn reset(&mut self, _now: Cycle) {
        let faults = self.faults;
        *self = Self {
            faults,
            ..Self::new()
        };
    }

    fn interrupt_lines(&self) -> u32 {
        u32::from(self.status() != 0) << INTERRUPT_LINE
    }
}
