//! How long things take on the bus (datasheet 4.3.14).

use super::super::clock::Cycle;

const BITS_OF_A_BYTE: u64 = 9;

/// The two halves of a clock of SCL, in cycles of `clk_sys`, which is `ic_clk`.
#[derive(Clone, Copy, Debug)]
pub struct Speed {
    pub low: Cycle,
    pub high: Cycle,
}

impl Speed {
    /// "The DW_apb_i2c adds one cycle to the programmed LCNT value" and "IC_SPKLEN + 7 cycles to the
    /// programmed HCNT value" (4.3.14.1).
    pub fn of_counts(hcnt: u32, lcnt: u32, spike_length: u32) -> Self {
        Self {
            low: u64::from(lcnt) + 1,
            high: u64::from(hcnt) + u64::from(spike_length) + 7,
        }
    }

    pub fn clocks(self, count: u64) -> Cycle {
        count * (self.low + self.high)
    }

    /// Eight bits and the acknowledgement.
    pub fn byte(self) -> Cycle {
        self.clocks(BITS_OF_A_BYTE)
    }

    /// Hold time of a START (tHD;STA).
    pub fn start(self) -> Cycle {
        self.high
    }

    /// SDA is let go while SCL is low, then set-up and hold time of a START.
    pub fn restart(self) -> Cycle {
        self.clocks(1) + self.high
    }

    /// SDA is pulled while SCL is low, then set-up time of a STOP (tSU;STO).
    pub fn stop(self) -> Cycle {
        self.clocks(1)
    }

    /// Time between a STOP and the next START (tBUF).
    pub fn idle(self) -> Cycle {
        self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_datasheets_example_counts_make_fast_mode_at_12_mhz() {
        // Table 460: program values 15 and 6 with a spike length of 1 are 16 and 14 cycles, 400 kHz.
        let speed = Speed::of_counts(6, 15, 1);
        assert_eq!((speed.low, speed.high), (16, 14));
        assert_eq!(12_000_000 / speed.clocks(1), 400_000);
    }
}
