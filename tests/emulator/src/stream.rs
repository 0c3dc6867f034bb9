//! The stream of results: from the converter into its FIFO, and on by DMA into RAM.
//!
//! A converter that never rests would wake the scheduler tens of thousands of times a second. It is advanced to the present, result
//! by result and each at its own time, on demand: before any access to a register of ADC or DMA, before a transfer of another DMA
//! channel, before a reset, before a change at the converter's inputs or at the pins of the circuit, and before a test gets the
//! board back. Registers therefore read the same as if every result had been an event. Each is one while it may raise an
//! interrupt, or while a channel does something else with results than to move them into RAM.
//!
//! RAM that the processor reads without having looked at a register of ADC or DMA first may be [`MAX_LAG`] behind.

use super::adc::FIFO_ADDRESS;
use super::bus::{SystemBus, lane, replicated};
use super::clock::{Cycle, NEVER, cycles};
use super::dma::{Transfer, TransferError};
use super::peripheral::Peripheral;
use super::register::RegisterWrite;

/// The longest time by which RAM may be behind while the processor executes.
const MAX_LAG: Cycle = cycles(100);

impl SystemBus {
    /// Brings the converter, and the channels that move its results, up to the present.
    pub(super) fn advance_stream(&mut self) {
        loop {
            let at = self.next_stream_event();
            if at > self.now {
                break;
            }
            self.stream_time = at;
            self.soc.adc.advance(at);
            let (channels, requests) = self.stream_requests();
            if let Some(transfer) = self.soc.dma.next_transfer(channels, requests, at) {
                let end = self.carry_out_in_stream(transfer, at);
                self.soc.dma.complete(transfer, end, at);
            }
        }
        self.stream_time = self.now;
    }

    /// When converter or channels do something next.
    fn next_stream_event(&self) -> Cycle {
        let (channels, requests) = self.stream_requests();
        let conversion = self.soc.adc.next_event();
        conversion.min(
            self.soc
                .dma
                .next_transfer_time(channels, requests)
                .max(self.stream_time),
        )
    }

    fn stream_requests(&self) -> (u32, u64) {
        (self.soc.dma.stream().channels, self.soc.adc.dma_requests())
    }

    /// A transfer between FIFO, RAM and the registers of DMA.
    fn carry_out_in_stream(&mut self, transfer: Transfer, at: Cycle) -> Result<(), TransferError> {
        if self.soc.dma.take_failure(transfer.channel) {
            return Err(TransferError::Read);
        }
        if transfer.from == FIFO_ADDRESS {
            let result = lane(self.soc.adc.pop(), transfer.from, transfer.width);
            let stored = self.store(transfer.to, result, transfer.width);
            return stored.map_err(|_| TransferError::Write);
        }
        let word = self.memory.load(transfer.from, transfer.width);
        let word = word.ok_or(TransferError::Read)?;
        let write = RegisterWrite::to_address(transfer.to, replicated(word, transfer.width));
        self.soc.dma.write(transfer.to & 0xfff, write, at);
        Ok(())
    }

    /// Whether nothing but a look at registers or RAM can show when it moves.
    fn stream_may_lag(&self) -> bool {
        self.soc.dma.stream().is_private && !self.soc.adc.may_interrupt()
    }

    /// Brings it up to the present if it may not be behind.
    pub(super) fn advance_stream_if_observed(&mut self) {
        if !self.stream_may_lag() {
            self.advance_stream();
        }
    }

    /// When the scheduler has to advance it next.
    pub(super) fn next_observed_stream_event(&self) -> Cycle {
        if self.stream_may_lag() {
            NEVER
        } else {
            self.next_stream_event()
        }
    }

    /// Keeps RAM within [`MAX_LAG`], for a processor that executes. Returns when to do so again.
    pub(super) fn limit_stream_lag(&mut self) -> Cycle {
        if self.now >= self.stream_time + MAX_LAG {
            self.advance_stream();
        }
        if self.next_stream_event() == NEVER {
            return NEVER;
        }
        self.stream_time + MAX_LAG
    }
}
