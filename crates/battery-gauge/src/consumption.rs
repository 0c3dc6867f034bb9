//! Integration of charge and energy drawn from a pack.

use crate::{Consumed, Contents};

/// Up to this interval the latest reading is integrated over all of it, as in ArduPilot and PX4.
pub const MAX_INTERVAL_US: u64 = 2_000_000;

/// An engine whose control unit has been silent for longer is off, in microseconds: as long as the unit stays healthy.
const ENGINE_SILENCE_US: u64 = 1_000_000;

/// Up to this gap the mean of the readings before and after is integrated; a longer one is not counted.
const MAX_INTERPOLATED_GAP_US: u64 = 60_000_000;

/// A gap in the current readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Duration, in seconds.
    pub duration_s: f32,
    /// The charge counted for it, in milliampere-hours; `None` if it was too long to interpolate.
    pub counted_mah: Option<f32>,
}

impl Gap {
    /// Both as one.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            duration_s: self.duration_s + other.duration_s,
            counted_mah: self.counted_mah.zip(other.counted_mah).map(|(a, b)| a + b),
        }
    }
}

/// Integrators of charge and energy, in integers: a float would lose small steps in a large sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Consumption {
    /// In nanocoulombs: 2.5 million ampere-hours fit.
    charge_nc: i64,
    /// In nanojoules.
    energy_nj: i64,
}

const NANOCOULOMBS_PER_MAH: f32 = 3.6e9;
const NANOJOULES_PER_WH: f32 = 3.6e12;
const NANO_PER_MICRO: f32 = 1e3;

impl Consumption {
    /// Integrates the `dt_us` since the previous reading, whose current was `previous_a`; returns a gap if they are too
    /// long. Without a power, energy is charge × voltage.
    pub fn integrate(
        &mut self,
        dt_us: u64,
        previous_a: f32,
        current_a: f32,
        voltage_v: Option<f32>,
        power_w: Option<f32>,
    ) -> Option<Gap> {
        let before = *self;
        let mean_a = mean_current_a(dt_us, Some(previous_a), current_a);
        if let Some(mean_a) = mean_a {
            // In a gap, the power is not that of the whole interval.
            self.add(
                dt_us,
                mean_a,
                voltage_v,
                power_w.filter(|_| dt_us <= MAX_INTERVAL_US),
            );
        }
        (dt_us > MAX_INTERVAL_US).then(|| Gap {
            duration_s: dt_us as f32 * 1e-6,
            counted_mah: mean_a.map(|_| self.charge_mah() - before.charge_mah()),
        })
    }

    fn add(&mut self, dt_us: u64, current_a: f32, voltage_v: Option<f32>, power_w: Option<f32>) {
        // An ampere for a microsecond is a microcoulomb. `as` saturates.
        let dt_ns = microseconds(dt_us) * NANO_PER_MICRO;
        let charge_nc = current_a * dt_ns;
        self.charge_nc = self.charge_nc.saturating_add(charge_nc as i64);
        let energy_nj = power_w
            .map(|power_w| power_w * dt_ns)
            .or(voltage_v.map(|voltage_v| charge_nc * voltage_v));
        if let Some(energy_nj) = energy_nj {
            self.energy_nj = self.energy_nj.saturating_add(energy_nj as i64);
        }
    }

    /// Adds the charge by which `now` exceeds `before`.
    pub fn add_charge_since(&mut self, now: &Self, before: &Self) {
        let added_nc = now.charge_nc.saturating_sub(before.charge_nc);
        self.charge_nc = self.charge_nc.saturating_add(added_nc);
    }

    /// Takes over the charge of `other`; the energy is kept.
    pub fn set_charge_of(&mut self, other: &Self) {
        self.charge_nc = other.charge_nc;
    }

    /// Adds the increment of a sensor's own counter.
    // Inlined, its 64-bit arithmetic would be repeated for each kind of counter.
    #[inline(never)]
    pub fn add_counted(&mut self, counted: Consumed) {
        let more = Self::from(counted);
        self.charge_nc = self.charge_nc.saturating_add(more.charge_nc);
        self.energy_nj = self.energy_nj.saturating_add(more.energy_nj);
    }

    /// Sets the charge to that of the pack's own fuel gauge; the energy is kept.
    pub fn set_charge_mah(&mut self, charge_mah: f32) {
        self.charge_nc = (charge_mah * NANOCOULOMBS_PER_MAH) as i64;
    }

    /// Restarts at `consumed`.
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

/// Mean current in the `dt_us` since the previous reading; `None` in a gap that is not interpolated. A charger feeds all
/// through a gap if it feeds at both ends; a braking motor at one end says nothing of the rest.
pub fn mean_current_a(dt_us: u64, previous_a: Option<f32>, current_a: f32) -> Option<f32> {
    if dt_us <= MAX_INTERVAL_US {
        return Some(current_a);
    }
    previous_a
        .filter(|_| dt_us <= MAX_INTERPOLATED_GAP_US)
        .map(|previous_a| {
            if previous_a < 0.0 && current_a < 0.0 {
                0.5 * (previous_a + current_a)
            } else {
                0.5 * (previous_a.max(0.0) + current_a.max(0.0))
            }
        })
}

/// Whether nothing was drawn since the previous reading, `dt_us` ago: a flow is measured by a control unit, which is supplied
/// while its engine runs. A pack supplies its load while it is not measured, too.
pub fn was_off(contents: Contents, dt_us: u64) -> bool {
    contents == Contents::Fuel && dt_us > ENGINE_SILENCE_US
}

/// A duration as a float, up to 71 minutes (saturating): of 32 bits the conversion takes fewer instructions.
pub fn microseconds(dt_us: u64) -> f32 {
    u32::try_from(dt_us).unwrap_or(u32::MAX) as f32
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
    fn microampere_is_counted_on_top_of_100_ampere_hours() {
        let mut consumption = Consumption::default();
        consumption.restart(Consumed {
            charge_mah: 100_000.0,
            energy_wh: 0.0,
        });
        let before = consumption.charge_nc;
        consumption.integrate(100_000, 0.0, 1e-6, None, None);
        assert_eq!(consumption.charge_nc - before, 100);
    }

    #[test]
    fn charging_current_subtracts() {
        let mut consumption = Consumption::default();
        consumption.integrate(1_000_000, 0.0, 3.6, Some(10.0), None);
        consumption.integrate(1_000_000, 0.0, -7.2, Some(10.0), None);
        assert!((consumption.charge_mah() + 1.0).abs() < 1e-6);
        assert!(consumption.energy_wh() < 0.0);
    }

    #[test]
    fn a_power_is_counted_as_energy_except_over_a_gap() {
        let mut consumption = Consumption::default();
        consumption.integrate(1_000_000, 2.0, 2.0, Some(8.0), Some(15.0));
        let energy_j = |consumption: &Consumption| consumption.energy_wh() * 3600.0;
        assert!((energy_j(&consumption) - 15.0).abs() < 1e-4);
        assert_eq!(consumption.charge_nc, 2_000_000_000);
        let _ = consumption.integrate(10_000_000, 2.0, 2.0, Some(8.0), Some(15.0));
        assert!((energy_j(&consumption) - 175.0).abs() < 1e-3);
    }

    #[test]
    fn a_gap_is_returned_and_interpolated_unless_it_is_long() {
        // 4 A for ten seconds.
        for (duration_s, expected_mah) in [(10, Some(11.111_111)), (61, None)] {
            let mut consumption = Consumption::default();
            let gap = consumption
                .integrate(duration_s * 1_000_000, 3.0, 5.0, Some(10.0), None)
                .expect("a gap");
            assert_eq!(gap.duration_s, duration_s as f32);
            assert_eq!(gap.counted_mah, expected_mah);
            assert_eq!(consumption.charge_mah(), expected_mah.unwrap_or(0.0));
        }
    }

    #[test]
    fn integrators_saturate() {
        let mut consumption = Consumption::default();
        for _ in 0..10 {
            consumption.integrate(u64::MAX, f32::MAX, f32::MAX, Some(f32::MAX), None);
            consumption.integrate(2_000_000, f32::MAX, f32::MAX, Some(f32::MAX), None);
        }
        assert_eq!(consumption.charge_nc, i64::MAX);
        assert!(consumption.charge_mah().is_finite() && consumption.energy_wh().is_finite());
    }
}
