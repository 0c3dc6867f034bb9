//! Charge and energy drawn from a pack.

use super::Consumed;

/// Up to this interval a reading stands for all of it, as in ArduPilot and PX4.
const LONGEST_INTERVAL_US: u64 = 2_000_000;

/// Over a longer gap the load is taken to have changed evenly, up to this long. After more than that nobody can say.
const LONGEST_GAP_US: u64 = 60_000_000;

/// A gap in the readings of the current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// How long it lasted, in seconds.
    pub duration_s: f32,
    /// The charge that was counted for it, in milliampere-hours; unknown if it was too long.
    pub counted_mah: Option<f32>,
}

/// Counts charge and energy in whole numbers, so that a small step is not lost in a large sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Consumption {
    /// In nanocoulombs: 2.5 million ampere-hours fit.
    charge_nc: i64,
    /// In nanojoules.
    energy_nj: i64,
}

const NANOCOULOMBS_PER_MAH: f32 = 3.6e9;
const NANOJOULES_PER_WH: f32 = 3.6e12;
const NANO_PER_MICRO: f32 = 1e3;

impl Consumption {
    /// Counts what was drawn in the `dt_us` since the reading before, whose current was `previous_a`.
    pub fn add(
        &mut self,
        dt_us: u64,
        previous_a: f32,
        current_a: f32,
        voltage_v: Option<f32>,
    ) -> Option<Gap> {
        if dt_us <= LONGEST_INTERVAL_US {
            self.count(dt_us, current_a, voltage_v);
            return None;
        }
        let before = *self;
        let counted = dt_us <= LONGEST_GAP_US;
        if counted {
            self.count(dt_us, 0.5 * (previous_a + current_a), voltage_v);
        }
        Some(Gap {
            duration_s: dt_us as f32 * 1e-6,
            counted_mah: counted.then(|| self.charge_mah() - before.charge_mah()),
        })
    }

    fn count(&mut self, dt_us: u64, current_a: f32, voltage_v: Option<f32>) {
        // An ampere for a microsecond is a microcoulomb. `as` saturates.
        let charge_nc = current_a * dt_us as f32 * NANO_PER_MICRO;
        self.charge_nc = self.charge_nc.saturating_add(charge_nc as i64);
        if let Some(voltage_v) = voltage_v {
            self.energy_nj = self.energy_nj.saturating_add((charge_nc * voltage_v) as i64);
        }
    }

    /// Adds what a sensor has counted.
    pub fn add_counted(&mut self, counted: Consumed) {
        let more = Self::from(counted);
        self.charge_nc = self.charge_nc.saturating_add(more.charge_nc);
        self.energy_nj = self.energy_nj.saturating_add(more.energy_nj);
    }

    /// What is missing from a full pack, as the pack itself knows; the energy is counted on.
    pub fn set_charge_mah(&mut self, charge_mah: f32) {
        self.charge_nc = (charge_mah * NANOCOULOMBS_PER_MAH) as i64;
    }

    /// Starts over with what is missing from a full pack.
    pub fn restart(&mut self, consumed: Consumed) {
        *self = Self::from(consumed);
    }

    pub fn to_words(self) -> [u32; 4] {
        let words = |value: i64| [value as u32, (value >> 32) as u32];
        let ([charge_low, charge_high], [energy_low, energy_high]) =
            (words(self.charge_nc), words(self.energy_nj));
        [charge_low, charge_high, energy_low, energy_high]
    }

    pub fn from_words([charge_low, charge_high, energy_low, energy_high]: [u32; 4]) -> Self {
        let value = |low: u32, high: u32| (u64::from(high) << 32 | u64::from(low)) as i64;
        Self {
            charge_nc: value(charge_low, charge_high),
            energy_nj: value(energy_low, energy_high),
        }
    }

    pub fn charge_mah(&self) -> f32 {
        self.charge_nc as f32 / NANOCOULOMBS_PER_MAH
    }

    pub fn energy_wh(&self) -> f32 {
        self.energy_nj as f32 / NANOJOULES_PER_WH
    }
}

impl From<Consumed> for Consumption {
    #[inline(never)]
    fn from(consumed: Consumed) -> Self {
        Self {
            charge_nc: (consumed.charge_mah * NANOCOULOMBS_PER_MAH) as i64,
            energy_nj: (consumed.energy_wh * NANOJOULES_PER_WH) as i64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_of_an_ampere_is_an_ampere_hour() {
        let mut consumption = Consumption::default();
        for _ in 0..36_000 {
            assert_eq!(consumption.add(100_000, 1.0, 1.0, Some(10.0)), None);
        }
        assert!(
            (consumption.charge_mah() - 1000.0).abs() < 0.01,
            "{}",
            consumption.charge_mah()
        );
        assert!((consumption.energy_wh() - 10.0).abs() < 1e-4);
    }

    #[test]
    fn a_microampere_is_counted_beside_a_hundred_ampere_hours() {
        let mut consumption = Consumption::default();
        consumption.restart(Consumed {
            charge_mah: 100_000.0,
            energy_wh: 0.0,
        });
        let before = consumption.charge_nc;
        consumption.add(100_000, 0.0, 1e-6, None);
        assert_eq!(consumption.charge_nc - before, 100);
    }

    #[test]
    fn charging_subtracts() {
        let mut consumption = Consumption::default();
        consumption.add(1_000_000, 0.0, 3.6, Some(10.0));
        consumption.add(1_000_000, 0.0, -7.2, Some(10.0));
        assert!((consumption.charge_mah() + 1.0).abs() < 1e-6);
        assert!(consumption.energy_wh() < 0.0);
    }

    #[test]
    fn a_gap_is_counted_with_the_mean_load_and_told() {
        let mut consumption = Consumption::default();
        let gap = consumption.add(10_000_000, 3.0, 5.0, Some(10.0)).expect("a gap");
        assert_eq!(gap.duration_s, 10.0);
        let counted_mah = gap.counted_mah.expect("counted");
        assert!((counted_mah - 4.0 * 10.0 / 3.6).abs() < 1e-3);
        assert_eq!(consumption.charge_mah(), counted_mah);
    }

    #[test]
    fn a_gap_that_is_too_long_is_told_and_not_guessed() {
        let mut consumption = Consumption::default();
        let gap = consumption.add(61_000_000, 3.0, 5.0, Some(10.0)).expect("a gap");
        assert_eq!(gap.counted_mah, None);
        assert_eq!(consumption, Consumption::default());
    }

    #[test]
    fn no_value_overflows() {
        let mut consumption = Consumption::default();
        for _ in 0..10 {
            consumption.add(u64::MAX, f32::MAX, f32::MAX, Some(f32::MAX));
            consumption.add(2_000_000, f32::MAX, f32::MAX, Some(f32::MAX));
        }
        assert_eq!(consumption.charge_nc, i64::MAX);
        assert!(consumption.charge_mah().is_finite() && consumption.energy_wh().is_finite());
    }
}
