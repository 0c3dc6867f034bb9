//! Emulated time: one count of `clk_sys`, and the clocks derived from it.
//!
//! The emulator's time base is a cycle counter of `clk_sys` at 125 MHz that starts at power-up and
//! never restarts. The firmware is expected to set up exactly these frequencies; a test can compare
//! them with what it really programmed (`Board::programmed_clk_sys_hz`). The few milliseconds the
//! chip runs from its ring oscillator before that are emulated at 125 MHz too.

/// A point in time, or a length of time, in cycles of `clk_sys` since power-up.
pub type Cycle = u64;

/// Frequency of `clk_sys` (and of `clk_peri`, which feeds the UARTs).
pub const CLK_SYS_HZ: u64 = 125_000_000;
/// Frequency of `clk_ref`: the 12 MHz crystal of the Pico.
pub const CLK_REF_HZ: u64 = 12_000_000;
/// Frequency of `clk_adc` ("the ADC requires a 48MHz clock", datasheet 4.9.2).
pub const CLK_ADC_HZ: u64 = 48_000_000;
/// Cycles of `clk_sys` in a microsecond.
pub const CYCLES_PER_US: u64 = CLK_SYS_HZ / 1_000_000;
/// The time of an event that is not going to happen.
pub const NEVER: Cycle = Cycle::MAX;

/// Microseconds to cycles.
pub const fn cycles(micros: u64) -> Cycle {
    micros * CYCLES_PER_US
}

/// Cycles to whole microseconds.
pub const fn micros(cycles: Cycle) -> u64 {
    cycles / CYCLES_PER_US
}

/// Cycles of `clk_adc` to cycles of `clk_sys`, rounded up.
pub const fn from_adc_clock(adc_cycles: u64) -> Cycle {
    (adc_cycles * CLK_SYS_HZ).div_ceil(CLK_ADC_HZ)
}

/// `clk_ref` and `clk_sys` without their common factor.
const REF_PART: u64 = CLK_REF_HZ / MEGAHERTZ;
const SYS_PART: u64 = CLK_SYS_HZ / MEGAHERTZ;
const MEGAHERTZ: u64 = 1_000_000;

/// The tick that drives TIMER and the watchdog: `clk_ref` divided by WATCHDOG.TICK.CYCLES
/// (datasheet 4.7.2). Twelve cycles of the 12 MHz crystal make the 1 µs both are meant to count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// WATCHDOG.TICK.CYCLES, from 1.
    pub ref_cycles: u64,
}

impl Tick {
    /// Whole ticks in a length of time.
    pub fn count_in(self, length: Cycle) -> u64 {
        length * REF_PART / (SYS_PART * self.ref_cycles)
    }

    /// The shortest time in which this many ticks have passed.
    pub fn time_of(self, ticks: u64) -> Cycle {
        let cycles = ticks.checked_mul(SYS_PART * self.ref_cycles);
        cycles.map_or(NEVER, |cycles| cycles.div_ceil(REF_PART))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twelve_cycles_of_the_crystal_are_one_microsecond() {
        let tick = Tick { ref_cycles: 12 };
        assert_eq!(tick.time_of(1), CYCLES_PER_US);
        assert_eq!(tick.count_in(cycles(1_000_000)), 1_000_000);
        assert_eq!(tick.count_in(cycles(1) - 1), 0);
    }

    #[test]
    fn a_conversion_of_96_adc_cycles_takes_2_microseconds() {
        assert_eq!(from_adc_clock(96), cycles(2));
    }
}
