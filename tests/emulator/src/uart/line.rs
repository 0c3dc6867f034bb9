//! The wire into a UART's receiver: frames a test sends, and the level they make.

use std::collections::VecDeque;

use super::super::clock::Cycle;
use super::super::floating::Floating;

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

    /// The first change after `time`, in whole cycles: the level is the new one then.
    fn change_after(self, time: Cycle) -> Option<Cycle> {
        (0..FRAME_BITS)
            .filter(|&index| self.level_of(index) != (index == 0 || self.level_of(index - 1)))
            .map(|index| self.start + (self.bit.fractions * index).div_ceil(FRACTION))
            .find(|&change| change > time)
    }

    /// The first change from high to low at or after `time`.
    fn falling_edge(self, time: Cycle) -> Option<Cycle> {
        (0..FRAME_BITS)
            .filter(|&index| !self.level_of(index) && (index == 0 || self.level_of(index - 1)))
            .map(|index| self.start + self.bit.bits(index))
            .find(|&edge| edge >= time)
    }
}

/// What the chip's end of a wire does while the other one is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pull {
    Up,
    Down,
    #[default]
    None,
}

/// Who decides the level of the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum OtherEnd {
    /// A sender, which holds it high between its frames.
    #[default]
    Sender,
    /// It is open, since this time.
    Open(Cycle),
}

/// The frames that are not over yet, in order of time; between them the line is high.
#[derive(Clone, Default)]
pub struct Line {
    frames: VecDeque<Frame>,
    free_at: Cycle,
    other_end: OtherEnd,
    pull: Pull,
    noise: Floating,
    /// Which of the inputs of `noise` it is.
    input: usize,
}

impl Line {
    /// A line at input `input` of those that may float as `noise` has it.
    pub fn new(noise: Floating, input: usize) -> Self {
        Self {
            noise,
            input,
            ..Self::default()
        }
    }

    /// From `now` on nothing is connected to the chip's pin. What is on the wire is lost.
    pub fn disconnect(&mut self, now: Cycle) {
        self.frames.clear();
        self.other_end = OtherEnd::Open(now);
    }

    /// How the pad pulls from `now` on.
    pub fn pull(&mut self, pull: Pull, now: Cycle) {
        if pull == self.pull {
            return;
        }
        self.pull = pull;
        if let OtherEnd::Open(since) = &mut self.other_end {
            *since = now;
        }
    }

    fn floats_high_at(&self, time: Cycle) -> bool {
        self.noise.levels_at(time) >> self.input & 1 != 0
    }

    /// The first time from `time` on at which noise falls.
    fn noise_falls(&self, time: Cycle) -> Option<Cycle> {
        let changes = std::iter::successors(Some(time), |&time| Some(self.noise.next_change(time)));
        changes
            .skip(1)
            .find(|&change| self.floats_high_at(change - 1) && !self.floats_high_at(change))
    }

    /// Connect a sender, and put its bytes on the wire back to back, from `start` or from the end of what is there already.
    pub fn send(&mut self, bytes: &[u8], start: Cycle, bit: BitTime) {
        self.other_end = OtherEnd::Sender;
        let mut start = start.max(self.free_at);
        for &byte in bytes {
            let frame = Frame { start, bit, byte };
            self.frames.push_back(frame);
            start = frame.end();
        }
        self.free_at = start;
    }

    pub fn level_at(&self, time: Cycle) -> bool {
        match (self.other_end, self.pull) {
            (OtherEnd::Sender, _) => {}
            (OtherEnd::Open(_), Pull::Up) => return true,
            (OtherEnd::Open(_), Pull::Down) => return false,
            (OtherEnd::Open(_), Pull::None) => return self.floats_high_at(time),
        }
        let frame = self.frames.iter().find(|frame| time < frame.end());
        frame.is_none_or(|frame| frame.level_at(time))
    }

    /// The next start bit a receiver that listens from `time` sees.
    pub fn falling_edge(&self, time: Cycle) -> Option<Cycle> {
        match (self.other_end, self.pull) {
            (OtherEnd::Sender, _) => self.frames.iter().find_map(|frame| frame.falling_edge(time)),
            (OtherEnd::Open(_), Pull::Up) => None,
            (OtherEnd::Open(since), Pull::Down) => (since >= time).then_some(since),
            (OtherEnd::Open(since), Pull::None) => self.noise_falls(time.max(since)),
        }
    }

    /// When the level may be another one after `time`.
    pub fn change_after(&self, time: Cycle) -> Option<Cycle> {
        match (self.other_end, self.pull) {
            (OtherEnd::Sender, _) => self.frames.iter().find_map(|frame| frame.change_after(time)),
            (OtherEnd::Open(_), Pull::Up | Pull::Down) => None,
            (OtherEnd::Open(_), Pull::None) => Some(self.noise.next_change(time)),
        }
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
    fn the_level_is_another_one_at_each_change() {
        let mut line = Line::default();
        line.send(b"\x00U\xff~", 1000, BitTime::of_baud(115_200));
        let changes: Vec<Cycle> =
            std::iter::successors(line.change_after(0), |&change| line.change_after(change)).collect();
        // Both edges of a byte of zeros, all ten of 0x55, two of ones, four of 0x7e.
        assert_eq!(changes.len(), 2 + 10 + 2 + 4);
        for change in changes {
            assert_ne!(line.level_at(change), line.level_at(change - 1), "{change}");
        }
    }

    #[test]
    fn an_open_line_follows_the_pull_and_is_noise_without_one() {
        let mut line = Line::new(Floating::new(5), 1);
        line.pull(Pull::Up, 0);
        line.disconnect(100);
        assert_eq!((line.level_at(200), line.falling_edge(0)), (true, None));
        line.pull(Pull::Down, 1000);
        assert_eq!((line.level_at(2000), line.falling_edge(100)), (false, Some(1000)));
        line.pull(Pull::None, 3000);
        let edge = line.falling_edge(3000).expect("noise falls again and again");
        assert!(line.level_at(edge - 1) && !line.level_at(edge));
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
