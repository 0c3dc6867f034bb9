//! What every peripheral model has in common.
//!
//! To add one: write it in a file of its own, give it a field and an id in [`super::soc`], and name
//! that id in the address map ([`super::memory_map`]).

use super::clock::{Cycle, NEVER};
use super::register::RegisterWrite;

/// A block of registers that lives in emulated time.
///
/// `now` never goes back. A model does nothing by itself: [`Self::advance`] is called whenever an
/// event is due and before and after each register access, so a read always sees the present.
pub trait Peripheral {
    /// Read the 32-bit register at `offset`, with its side effects.
    fn read(&mut self, offset: u32, now: Cycle) -> u32;

    /// Write the 32-bit register at `offset`.
    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle);

    /// Back to the state after reset, as RESETS or a chip reset does it. What is outside the chip
    /// (wires, voltages, a test's faults and records) stays.
    fn reset(&mut self, now: Cycle);

    /// Do everything that is due up to and including `now`.
    fn advance(&mut self, _now: Cycle) {}

    /// When [`Self::advance`] is needed next.
    fn next_event(&self) -> Cycle {
        NEVER
    }

    /// Interrupt lines this block holds high, as a bit set of NVIC numbers (datasheet 2.3.2).
    fn interrupt_lines(&self) -> u32 {
        0
    }

    /// DMA requests this block holds high, as a bit set of DREQ numbers (datasheet 2.5.3.1).
    fn dma_requests(&self) -> u64 {
        0
    }
}
