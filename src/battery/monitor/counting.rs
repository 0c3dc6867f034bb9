//! Charge and energy drawn from a pack, wherever they are counted.

use crate::battery::consumption::{Consumption, Gap};
use crate::battery::counter::{Change, SourceCounter};
use crate::battery::estimator::Reading;
use crate::battery::gauge::GaugeState;
use crate::battery::{Consumed, Counted, Measurement};
use crate::time::Instant;

/// Counts what is drawn from one pack.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counting {
    consumption: Consumption,
    counter: SourceCounter,
    /// Drawn since the start: neither a battery reset nor another pack changes it.
    drawn: Consumption,
    last_current: Option<LastCurrent>,
}

/// The latest known current: a reading may come without one.
#[derive(Clone, Copy, Debug)]
struct LastCurrent {
    time: Instant,
    current_a: f32,
}

/// What a reading adds to the consumption.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Count {
    pub gap: Option<Gap>,
    /// Counted by the source since the reading before, in milliampere-hours.
    pub at_source_mah: Option<f32>,
}

impl Count {
    fn at_source(charge_mah: f32) -> Self {
        Self {
            gap: None,
            at_source_mah: Some(charge_mah),
        }
    }
}

impl Counting {
    /// Takes a reading, with what is known of the pack's gauge.
    pub fn update(&mut self, now: Instant, measurement: &Measurement, gauge: &GaugeState) -> Count {
        match measurement.counted {
            Some(Counted::Increment(consumed)) => self.add_counted(consumed),
            Some(Counted::Total(total)) => match self.counter.total(total) {
                Change::First => {
                    self.consumption.restart(total);
                    Count::at_source(0.0)
                }
                Change::Increase(consumed) => self.add_counted(consumed),
            },
            Some(Counted::TotalCharge(total_mah)) => {
                self.integrate_energy(now, measurement);
                let total = Consumed {
                    charge_mah: total_mah,
                    energy_wh: 0.0,
                };
                match self.counter.total(total) {
                    Change::First => {
                        self.consumption.set_charge_mah(total_mah);
                        Count::at_source(0.0)
                    }
                    Change::Increase(consumed) => self.add_counted(consumed),
                }
            }
            Some(Counted::Members { consumed, drawn_mah }) => {
                self.consumption.restart(consumed);
                let Some(drawn_mah) = drawn_mah else {
                    return Count::default();
                };
                let charge_mah = self.counter.members(drawn_mah);
                self.drawn.add_counted(Consumed {
                    charge_mah,
                    energy_wh: 0.0,
                });
                Count::at_source(charge_mah)
            }
            None => self.count_here(now, measurement, gauge),
        }
    }

    fn add_counted(&mut self, consumed: Consumed) -> Count {
        self.consumption.add_counted(consumed);
        self.drawn.add_counted(consumed);
        Count::at_source(consumed.charge_mah)
    }

    /// Integrates the current; the charge is a gauge's, where there is one.
    fn count_here(&mut self, now: Instant, measurement: &Measurement, gauge: &GaugeState) -> Count {
        if gauge.full_mah().is_some() {
            // A gap does not matter.
            self.integrate_energy(now, measurement);
            if let Some(gauge) = gauge.valid() {
                let charge_mah = gauge.consumed_mah();
                self.consumption.set_charge_mah(charge_mah);
                let total = Consumed {
                    charge_mah,
                    energy_wh: 0.0,
                };
                if let Change::Increase(consumed) = self.counter.total(total) {
                    self.drawn.add_counted(consumed);
                }
            }
            return Count::default();
        }
        let before = self.consumption;
        let gap = self.integrate(now, measurement);
        self.drawn.add_charge_since(&self.consumption, &before);
        Count {
            gap,
            at_source_mah: None,
        }
    }

    /// Integrates the energy; the charge is counted elsewhere.
    fn integrate_energy(&mut self, now: Instant, measurement: &Measurement) {
        let before = self.consumption;
        let _ = self.integrate(now, measurement);
        self.consumption.set_charge_of(&before);
    }

    /// Integrates the current since it was known last, also over readings without one.
    fn integrate(&mut self, now: Instant, measurement: &Measurement) -> Option<Gap> {
        let current_a = measurement.current_a?;
        let last = self.last_current?;
        let dt_us = now.us_since(last.time);
        self.consumption
            .integrate(dt_us, last.current_a, current_a, measurement.voltage_v)
    }

    /// The current of a reading, from which the next interval is integrated.
    pub fn remember(&mut self, now: Instant, current_a: Option<f32>) {
        let known = current_a.map(|current_a| LastCurrent { time: now, current_a });
        self.last_current = known.or(self.last_current);
    }

    /// Adds to `reading` what the source has counted beyond its current.
    pub fn correct(&mut self, reading: &mut Reading, counted_mah: f32, is_measured: bool) {
        self.counter.correct(reading, counted_mah, is_measured);
    }

    /// The most that a count at the source leaves of the larger of these capacities, from 0 to 1.
    pub fn share_at_most(&self, capacities_mah: [Option<f32>; 2]) -> f32 {
        if !self.counter.has_counted() {
            return 1.0;
        }
        let largest = capacities_mah.into_iter().flatten().reduce(f32::max);
        largest.map_or(1.0, |capacity_mah| self.share_left(capacity_mah))
    }

    /// What is left of this capacity, from 0 to 1.
    pub fn share_left(&self, capacity_mah: f32) -> f32 {
        (1.0 - self.charge_mah() / capacity_mah).clamp(0.0, 1.0)
    }

    /// Since the start or the last battery reset, in milliampere-hours.
    pub fn charge_mah(&self) -> f32 {
        self.consumption.charge_mah()
    }

    /// The same in watt-hours.
    pub fn energy_wh(&self) -> f32 {
        self.consumption.energy_wh()
    }

    /// Since the start, in milliampere-hours.
    pub fn drawn_mah(&self) -> f32 {
        self.drawn.charge_mah()
    }

    /// The pack was swapped.
    pub fn replace_pack(&mut self) {
        self.consumption = Consumption::default();
        self.counter.rebase();
    }

    /// Restarts at `consumed`.
    pub fn restart(&mut self, consumed: Consumed) {
        self.consumption.restart(consumed);
        self.counter.rebase();
    }

    /// What is retained over a reset of the processor.
    pub fn consumption(&self) -> Consumption {
        self.consumption
    }

    /// Continues with what was retained.
    pub fn restore(&mut self, consumption: Consumption) {
        self.consumption = consumption;
        if consumption != Consumption::default() {
            self.counter.rebase();
        }
    }
}
