//! The receive half of the PL011: samples the line, fills the FIFO (datasheet 4.2.4, 4.2.6).

use std::collections::VecDeque;

use super::super::clock::{Cycle, NEVER};
use super::line::{BitTime, Line};
use super::settings::Settings;

/// Error flags of a received character, at their places in UARTDR.
pub const FRAMING: u16 = 1 << 8;
pub const BREAK: u16 = 1 << 10;
pub const OVERRUN: u16 = 1 << 11;

/// "The receive timeout interrupt is asserted when the receive FIFO is not empty, and no more data
/// is received during a 32-bit period" (datasheet 4.2.6.4).
const TIMEOUT_BITS: u64 = 32;

/// What one advance of the receiver has brought about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reception {
    /// A character went into the FIFO, with these error flags.
    Received(u16),
    /// A character came while the FIFO was full.
    Overrun,
    /// The line has been quiet for 32 bits with data waiting.
    Timeout,
    /// It fell for less than half a bit.
    FalseStart,
}

#[derive(Clone, Default)]
pub struct Receiver {
    pub line: Line,
    fifo: VecDeque<u16>,
    /// The start bit of the character being received.
    start: Option<Cycle>,
    /// From when on the receiver looks for a start bit.
    listening_from: Cycle,
    timeout_at: Option<Cycle>,
    overrun: bool,
    /// Characters lost because the FIFO was full.
    pub overruns: u64,
}

impl Receiver {
    pub fn new(line: Line) -> Self {
        Self {
            line,
            ..Self::default()
        }
    }

    pub fn level(&self) -> usize {
        self.fifo.len()
    }

    pub fn pop(&mut self) -> Option<u16> {
        let character = self.fifo.pop_front();
        if self.fifo.is_empty() {
            self.timeout_at = None;
        }
        character
    }

    /// Drop everything that is inside the chip; what is on the wire stays there.
    pub fn reset(&mut self, now: Cycle) {
        self.fifo.clear();
        self.start = None;
        self.listening_from = now;
        self.timeout_at = None;
        self.overrun = false;
    }

    /// A receiver that is off, or whose pin is not connected, hears nothing of what passes.
    pub fn ignore_until(&mut self, now: Cycle) {
        self.start = None;
        self.listening_from = now;
        self.line.forget_before(now);
    }

    /// The next thing that happens up to `now`, in order of time.
    pub fn advance(&mut self, now: Cycle, settings: &Settings) -> Option<Reception> {
        let sampled = self.sampling_ends(settings);
        if let Some(timeout) = self.timeout_at.filter(|&at| at <= now && at < sampled) {
            self.timeout_at = None;
            debug_assert!(timeout <= now);
            return Some(Reception::Timeout);
        }
        (sampled <= now).then(|| self.receive(sampled, settings))
    }

    /// "The start bit is valid if UARTRXD is still LOW on the eighth cycle of Baud16, otherwise a false start bit is detected
    /// and it is ignored" (PL011 TRM, 2.4.3).
    fn skip_false_start(&mut self, start: Cycle, settings: &Settings) -> bool {
        let middle = start + sample_offset(settings.bit, 0);
        let is_false = self.line.level_at(middle);
        if is_false {
            self.listening_from = middle;
        }
        is_false
    }

    pub fn next_event(&self, settings: &Settings) -> Cycle {
        self.sampling_ends(settings).min(self.timeout_at.unwrap_or(NEVER))
    }

    /// A character is complete in the middle of its stop bit.
    fn sampling_ends(&self, settings: &Settings) -> Cycle {
        let start = self.start.or_else(|| self.line.falling_edge(self.listening_from));
        start.map_or(NEVER, |start| {
            start + sample_offset(settings.bit, settings.bits_before_stop())
        })
    }

    fn receive(&mut self, sampled: Cycle, settings: &Settings) -> Reception {
        let stop_offset = sample_offset(settings.bit, settings.bits_before_stop());
        let start = sampled - stop_offset;
        if self.skip_false_start(start, settings) {
            return Reception::FalseStart;
        }
        let bit_at = |number| self.line.level_at(start + sample_offset(settings.bit, number));
        let mut character: u16 = (0..settings.data_bits)
            .map(|number| u16::from(bit_at(number + 1)) << number)
            .sum();
        if !self.line.level_at(sampled) {
            let is_break = character == 0;
            character |= if is_break { BREAK | FRAMING } else { FRAMING };
        }
        self.start = None;
        self.listening_from = sampled;
        self.line.forget_before(sampled);
        self.store(character, sampled, settings)
    }

    /// The overrun flag goes with the next character that finds room (PL011 TRM, 2.4.4).
    fn store(&mut self, character: u16, now: Cycle, settings: &Settings) -> Reception {
        if self.fifo.len() >= settings.fifo_depth() {
            self.overrun = true;
            self.overruns += 1;
            return Reception::Overrun;
        }
        let overrun = if std::mem::take(&mut self.overrun) {
            OVERRUN
        } else {
            0
        };
        self.fifo.push_back(character | overrun);
        self.timeout_at = Some(now + settings.bit.bits(TIMEOUT_BITS));
        Reception::Received(character & (FRAMING | BREAK))
    }
}

/// The middle of bit `number`, counted from the start bit (0).
fn sample_offset(bit: BitTime, number: u64) -> Cycle {
    bit.half_bits(2 * number + 1)
}
