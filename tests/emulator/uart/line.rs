//! The wire into a UART's receiver: frames a test sends, and the level they make.

use std::collections::VecDeque;

use super::super::clock::Cycle;

/// Times on the wire are kept in 1/64 of a cycle, the resolution of a fractional baud divisor
/// (a bit takes 16 × (IBRD + FBRD / 64) cycles).
pub const FRACTION: u64 = 64;

/// Length of one bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTime {
    /// In 1/64 of a cycle.
    pub fractions: u64,
}

impl BitTime {
    /// For a baud rate as a foreign device would generate it.
    pub fn of_baud(baud: u32) -> Self {
        Self {
            fractions: super::super::clock::CLK_SYS_HZ * FRACTION / u64::from(baud),
        }
    }

    /// `halves` half bits, in whole cycles.
    pub fn half_bits(self, halves: u64) -> Cycle {
        self.fractions * halves / (2 * FRACTION)
    }

    pub fn bits(self, bits: u64) -> Cycle {
        self.half_bits(2 * bits)
    }
}

/// A byte on its way: start bit, eight data bits from the lowest, one stop bit.
#[derive(Clone, Copy, Debug)]
struct Frame {
    start: Cycle,
    bit: BitTime,
    byte: u8,
}

const FRAME_BITS: u64 = 10;

impl Frame {
    fn end(self) -> Cycle {
        self.start + self.bit.bits(FRAME_BITS)
    }

    /// The level during bit `index`: 0 is the start bit, 9 the stop bit.
    fn level_of(self, index: u64) -> bool {
        match index {
            0 => false,
            1..=8 => self.byte >> (index - 1) & 1 != 0,
            _ => true,
        }
    }

    fn level_at(self, time: Cycle) -> bool {
        let index = (time.saturating_sub(self.start)) * FRACTION / self.bit.fractions;
        time < self.start || self.level_of(index)
    }

    /// The first change from high to low at or after `time`.
    fn falling_edge(self, time: Cycle) -> Option<Cycle> {
        (0..FRAME_BITS)
            .filter(|&index| !self.level_of(index) && (index == 0 || self.level_of(index - 1)))
            .map(|index| self.start + self.bit.bits(index))
            .find(|&edge| edge >= time)
    }
}

/// The frames that are not over yet, in order of time; between them the line is high.
#[derive(Default)]
pub struct Line {
    frames: VecDeque<Frame>,
    free_at: Cycle,
}

impl Line {
    /// Put bytes on the wire back to back, from `start` or from the end of what is there already.
    pub fn send(&mut self, bytes: &[u8], start: Cycle, bit: BitTime) {
        let mut start = start.max(self.free_at);
        for &byte in bytes {
            let frame = Frame { start, bit, byte };
            self.frames.push_back(frame);
            start = frame.end();
        }
        self.free_at = start;
    }

    pub fn level_at(&self, time: Cycle) -> bool {
        let frame = self.frames.iter().find(|frame| time < frame.end());
        frame.is_none_or(|frame| frame.level_at(time))
    }

    /// The next start bit a receiver that listens from `time` sees.
    pub fn falling_edge(&self, time: Cycle) -> Option<Cycle> {
        self.frames.iter().find_map(|frame| frame.falling_edge(time))
    }

    /// Forget what was over before `time`.
    pub fn forget_before(&mut self, time: Cycle) {
        while self.frames.front().is_some_and(|frame| frame.end() < time) {
            self.frames.pop_front();
        }
    }

    /// When the last byte sent so far is over.
    pub fn free_at(&self) -> Cycle {
        self.free_at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_start_bit_data_from_the_lowest_bit_and_stop_bit() {
        let mut line = Line::default();
        let bit = BitTime {
            fractions: 100 * FRACTION,
        };
        line.send(&[0b0000_0101], 1000, bit);
        let levels: Vec<bool> = (0..10).map(|index| line.level_at(1050 + 100 * index)).collect();
        let expected = [0, 1, 0, 1, 0, 0, 0, 0, 0, 1].map(|level| level == 1);
        assert_eq!(levels, expected);
        assert!(line.level_at(900) && line.level_at(2500), "idle is high");
    }

    #[test]
    fn bytes_follow_each_other_without_a_gap() {
        let mut line = Line::default();
        let bit = BitTime::of_baud(115_200);
        line.send(&[0x55, 0x55], 0, bit);
        assert_eq!(line.falling_edge(bit.bits(9)), Some(bit.bits(10)));
        assert_eq!(line.free_at(), 2 * bit.bits(10));
    }
}
