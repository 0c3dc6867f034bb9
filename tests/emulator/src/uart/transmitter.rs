//! The transmit half of the PL011: FIFO and shift register.

use std::collections::VecDeque;

use super::super::clock::{Cycle, NEVER};
use super::settings::Settings;

/// A byte that left the chip, as the device at the other end of the wire receives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SentByte {
    pub byte: u8,
    /// When its start bit began.
    pub start: Cycle,
    /// When its stop bit was over.
    pub end: Cycle,
}

#[derive(Clone, Default)]
pub struct Transmitter {
    fifo: VecDeque<u8>,
    shifting: Option<SentByte>,
}

impl Transmitter {
    pub fn level(&self) -> usize {
        self.fifo.len()
    }

    /// UARTFR.BUSY: "remains set until the complete byte, including all the stop bits, has been
    /// sent from the shift register".
    pub fn is_busy(&self) -> bool {
        self.shifting.is_some() || !self.fifo.is_empty()
    }

    /// A byte written while the FIFO is full is lost.
    pub fn push(&mut self, byte: u8, settings: &Settings) {
        if self.fifo.len() < settings.fifo_depth() {
            self.fifo.push_back(byte);
        }
    }

    /// Move the next byte from the FIFO to an idle shift register; true when one moved.
    pub fn start_next(&mut self, now: Cycle, settings: &Settings) -> bool {
        if self.shifting.is_some() || !settings.has_baud_rate() {
            return false;
        }
        let Some(byte) = self.fifo.pop_front() else {
            return false;
        };
        let end = now + settings.bit.bits(settings.frame_bits());
        self.shifting = Some(SentByte {
            byte,
            start: now,
            end,
        });
        true
    }

    /// The byte whose stop bit is over by `now`.
    pub fn finish(&mut self, now: Cycle) -> Option<SentByte> {
        self.shifting.take_if(|byte| byte.end <= now)
    }

    pub fn next_event(&self) -> Cycle {
        self.shifting.map_or(NEVER, |byte| byte.end)
    }
}
