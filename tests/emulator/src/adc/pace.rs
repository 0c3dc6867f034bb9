//! The pace of conversions (datasheet 4.9.2.2), without rounding.

use super::super::clock::{CLK_ADC_HZ, CLK_SYS_HZ, Cycle};

/// "Capturing a sample takes 96 clock cycles (96 × 1/48MHz) = 2μs per sample" (4.9.2).
const CONVERSION_ADC_CYCLES: u64 = 96;
/// DIV.FRAC is in 256ths of a cycle of `clk_adc`.
const FRACTIONS: u64 = 256;
const MEGAHERTZ: u64 = 1_000_000;
/// A cycle of either clock in units of which both are whole numbers, as is the fraction of DIV.
const UNITS_PER_SYS_CYCLE: u64 = CLK_ADC_HZ / MEGAHERTZ * FRACTIONS;
const UNITS_PER_FRACTION: u64 = CLK_SYS_HZ / MEGAHERTZ;
const UNITS_PER_CONVERSION: u64 = CONVERSION_ADC_CYCLES * FRACTIONS * UNITS_PER_FRACTION;

/// A point in time since power-up, exact in cycles of both `clk_sys` and `clk_adc`: 1/1.536 THz, for 139 days.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct AdcTime(u64);

impl AdcTime {
    pub fn of(cycle: Cycle) -> Self {
        Self(cycle.saturating_mul(UNITS_PER_SYS_CYCLE))
    }

    /// The first cycle of `clk_sys` at which it has come.
    pub fn cycle(self) -> Cycle {
        self.0.div_ceil(UNITS_PER_SYS_CYCLE)
    }

    /// The end of a conversion that starts now.
    pub fn after_conversion(self) -> Self {
        Self(self.0 + UNITS_PER_CONVERSION)
    }

    /// The first trigger at or after `earliest`, if one comes now and then at the pace of `div`.
    pub fn next_trigger(self, div: u32, earliest: Self) -> Self {
        let trigger = trigger_units(div);
        let missed = earliest.0.saturating_sub(self.0).div_ceil(trigger);
        Self(self.0 + missed * trigger)
    }
}

/// Triggers of START_MANY: back to back without a divider, else every 1 + INT + FRAC/256 cycles of `clk_adc`. The fraction is an
/// average here, not a delta-sigma.
fn trigger_units(div: u32) -> u64 {
    if div == 0 {
        return UNITS_PER_CONVERSION;
    }
    (FRACTIONS + u64::from(div)) * UNITS_PER_FRACTION
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_conversion_takes_2_microseconds() {
        assert_eq!(AdcTime::of(1000).after_conversion().cycle(), 1250);
    }

    #[test]
    fn a_trigger_is_rounded_once_however_many_came_before() {
        // 2,934 cycles of 48 MHz are 7,640.625 of 125 MHz.
        let div = 2933 << 8;
        let mut trigger = AdcTime::of(0);
        for number in 1..=1_000_000_u64 {
            trigger = trigger.next_trigger(div, trigger.after_conversion());
            assert_eq!(trigger.cycle(), (number * 7_640_625).div_ceil(1000));
        }
    }

    #[test]
    fn triggers_within_a_conversion_are_missed() {
        // Eight cycles of 48 MHz are too short: every twelfth of them counts, and with seven every fourteenth.
        for (int, triggers) in [(7, 12 * 8), (6, 14 * 7)] {
            let start = AdcTime::of(0);
            let next = start.next_trigger(int << 8, start.after_conversion());
            assert_eq!(next.cycle(), (triggers * 125_u64).div_ceil(48));
        }
    }

    #[test]
    fn the_fraction_is_in_256ths() {
        let start = AdcTime::of(0);
        // 192 and 128/256 cycles of 48 MHz.
        let next = start.next_trigger(191 << 8 | 128, start.after_conversion());
        assert_eq!(next.cycle(), (1925 * 125_u64).div_ceil(480));
    }
}
