//! Baud rate and frame format of a UART (UARTIBRD, UARTFBRD, UARTLCR_H; datasheet 4.2.7).

use super::super::register::{bit, field};
use super::line::BitTime;

const FIFO_DEPTH: usize = 32;

const LCR_PEN: u32 = 1;
const LCR_STP2: u32 = 3;
const LCR_FEN: u32 = 4;
const LCR_WLEN: u32 = 5;

/// The settings in force: UARTIBRD and UARTFBRD take effect when UARTLCR_H is written
/// ("an LCR_H write must always be performed at the end", datasheet 4.2.7.1).
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub bit: BitTime,
    pub data_bits: u64,
    parity: bool,
    two_stop_bits: bool,
    fifo_enabled: bool,
}

impl Settings {
    pub fn latch(lcr_h: u32, ibrd: u32, fbrd: u32) -> Self {
        let divisor_in_64ths = u64::from(ibrd) * 64 + u64::from(fbrd);
        Self {
            bit: BitTime {
                fractions: 16 * divisor_in_64ths,
            },
            data_bits: 5 + u64::from(field(lcr_h, LCR_WLEN, 2)),
            parity: bit(lcr_h, LCR_PEN),
            two_stop_bits: bit(lcr_h, LCR_STP2),
            fifo_enabled: bit(lcr_h, LCR_FEN),
        }
    }

    /// IBRD 0 is not a baud rate: nothing moves.
    pub fn has_baud_rate(&self) -> bool {
        self.bit.fractions >= 16 * 64
    }

    /// Start bit, data bits and parity bit.
    pub fn bits_before_stop(&self) -> u64 {
        1 + self.data_bits + u64::from(self.parity)
    }

    pub fn frame_bits(&self) -> u64 {
        self.bits_before_stop() + if self.two_stop_bits { 2 } else { 1 }
    }

    /// With the FIFOs disabled each is "a 1-byte-deep holding register" (UARTLCR_H.FEN).
    pub fn fifo_depth(&self) -> usize {
        if self.fifo_enabled { FIFO_DEPTH } else { 1 }
    }

    /// The FIFO level a UARTIFLS selection stands for; 1 without a FIFO.
    pub fn trigger_level(&self, selection: u32) -> usize {
        if !self.fifo_enabled {
            return 1;
        }
        match selection {
            0 => FIFO_DEPTH / 8,
            1 => FIFO_DEPTH / 4,
            2 => FIFO_DEPTH / 2,
            3 => FIFO_DEPTH * 3 / 4,
            _ => FIFO_DEPTH * 7 / 8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_datasheets_example_divisor_gives_115200_baud() {
        // Datasheet 4.2.7.1: 125 MHz and 115200 baud need 67 + 52/64.
        let settings = Settings::latch(0x70, 67, 52);
        let baud = 125_000_000.0 * 64.0 / settings.bit.fractions as f64;
        assert!((baud - 115_207.0).abs() < 1.0, "{baud}");
        assert_eq!(settings.frame_bits(), 10);
        assert_eq!(settings.fifo_depth(), 32);
    }

    #[test]
    fn frame_formats_count_their_bits() {
        let bits = |lcr_h| Settings::latch(lcr_h, 1, 0).frame_bits();
        assert_eq!(bits(0b11 << LCR_WLEN), 10);
        assert_eq!(bits(0b11 << LCR_WLEN | 1 << LCR_PEN), 11);
        assert_eq!(bits(0b11 << LCR_WLEN | 1 << LCR_STP2), 11);
        assert_eq!(bits(0), 7);
    }
}
