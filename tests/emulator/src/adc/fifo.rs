//! The ADC's sample FIFO (datasheet 4.9.2.4).

use std::collections::VecDeque;

use super::super::register::{RegisterWrite, bit, field};

/// Eight samples. Datasheets up to 2023 say four; that was a mistake of the document, found on
/// silicon (github.com/raspberrypi/pico-feedback/issues/357) and corrected since.
pub const DEPTH: usize = 8;

const EN: u32 = 0;
const SHIFT: u32 = 1;
const ERR: u32 = 2;
const DREQ_EN: u32 = 3;
const UNDER: u32 = 10;
const OVER: u32 = 11;
const THRESH: u32 = 24;
const WRITABLE: u32 = 0x0f00_000f;

/// FIFO word: the conversion had an error.
const WORD_ERR: u16 = 1 << 15;

#[derive(Clone, Default)]
pub struct SampleFifo {
    control: u32,
    samples: VecDeque<u16>,
    underflowed: bool,
    overflowed: bool,
}

impl SampleFifo {
    /// FCS.
    pub fn status(&self) -> u32 {
        let level = self.samples.len();
        self.control
            | u32::from(level == 0) << 8
            | u32::from(level == DEPTH) << 9
            | u32::from(self.underflowed) << UNDER
            | u32::from(self.overflowed) << OVER
            | (level as u32) << 16
    }

    pub fn write_control(&mut self, write: RegisterWrite) {
        self.underflowed &= !bit(write.value, UNDER);
        self.overflowed &= !bit(write.value, OVER);
        write.update(&mut self.control, WRITABLE);
        assert!(
            !bit(self.control, SHIFT),
            "samples of eight bits are not modelled"
        );
    }

    /// A conversion has finished: FCS.EN says whether its result is kept here.
    pub fn push(&mut self, code: u16, error: bool) {
        if !bit(self.control, EN) {
            return;
        }
        if self.samples.len() == DEPTH {
            self.overflowed = true;
            return;
        }
        let error = if error && bit(self.control, ERR) {
            WORD_ERR
        } else {
            0
        };
        self.samples.push_back(code | error);
    }

    pub fn pop(&mut self) -> u16 {
        let sample = self.samples.pop_front();
        self.underflowed |= sample.is_none();
        sample.unwrap_or(0)
    }

    /// FCS.THRESH: "DREQ/IRQ asserted when level >= threshold". With a threshold of 0 that is
    /// always, FIFO enabled or not, and drivers make use of it.
    pub fn reached_threshold(&self) -> bool {
        self.samples.len() >= field(self.control, THRESH, 4) as usize
    }

    /// FCS.DREQ_EN: "assert DMA requests when FIFO contains data".
    pub fn requests_dma(&self) -> bool {
        bit(self.control, DREQ_EN) && !self.samples.is_empty() && self.reached_threshold()
    }
}
