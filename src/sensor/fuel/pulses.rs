//! Pulse counting and timing on a digital pin.

use crate::time::Instant;

/// GPIO number of the pulse input (`BATT_CURR_PIN`).
pub const PULSE_GPIO: i32 = 17;

/// Count and timing of pulses since boot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pulses {
    /// Rising edges, modulo 2^32.
    pub(super) count: u32,
    /// Time of the last rising edge.
    pub(super) last_rise: Option<Instant>,
    /// Time of the last falling edge.
    pub(super) last_fall: Option<Instant>,
    /// Widths of the last three, in µs.
    widths_us: [u32; 3],
}

impl Pulses {
    /// No pulses.
    pub const NONE: Self = Self {
        count: 0,
        last_rise: None,
        last_fall: None,
        widths_us: [0; 3],
    };

    /// Rising edge.
    pub fn rise(&mut self, now: Instant) {
        self.count = self.count.wrapping_add(1);
        self.last_rise = Some(now);
    }

    /// Falling edge.
    pub fn fall(&mut self, now: Instant) {
        let Some(rise) = self.last_rise else { return };
        let width_us = now.us_since(rise);
        let [latest, before, _] = self.widths_us;
        self.widths_us = [u32::try_from(width_us).unwrap_or(u32::MAX), latest, before];
        self.last_fall = Some(now);
    }

    /// Pulse width, in µs: the median of three, which rejects one measured late by a busy processor.
    pub(super) fn width_us(&self) -> u32 {
        let [a, b, c] = self.widths_us;
        a.min(b).max(a.max(b).min(c))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    /// Pulses of these widths, one every 20 ms.
    fn pulses(widths_us: &[u64]) -> Pulses {
        let mut pulses = Pulses::NONE;
        for (start_us, width_us) in (0..).step_by(20_000).zip(widths_us) {
            pulses.rise(at_us(start_us));
            pulses.fall(at_us(start_us + width_us));
        }
        pulses
    }

    #[test]
    fn pulses_are_counted_and_timed() {
        let pulses = pulses(&[1500, 1501, 1502]);
        assert_eq!(pulses.count, 3);
        assert_eq!(pulses.last_rise, Some(at_us(40_000)));
        assert_eq!(pulses.last_fall, Some(at_us(41_502)));
        assert_eq!(pulses.width_us(), 1501);
    }

    #[test]
    fn median_rejects_one_wrong_width() {
        for wrong_us in [0, 700, 2900, 1 << 40] {
            for place in 0..3 {
                let mut widths_us = [1500; 3];
                widths_us[place] = wrong_us;
                assert_eq!(pulses(&widths_us).width_us(), 1500, "{wrong_us} at {place}");
            }
        }
    }

    #[test]
    fn falling_edge_without_a_rising_one_is_ignored() {
        let mut pulses = Pulses::NONE;
        pulses.fall(at_us(10));
        assert_eq!(pulses, Pulses::NONE);
    }
}
