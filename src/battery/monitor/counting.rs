//! Charge and energy drawn from a pack, wherever they are counted: here, at the source, or by the pack's own fuel gauge.

use crate::battery::consumption::{Consumption, Gap};
use crate::battery::estimator::Reading;
use crate::battery::{Consumed, Counted, Gauge, GaugeReading, Measurement};
use crate::time::Instant;

/// Counts what is drawn from one pack.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChargeCounter {
    consumption: Consumption,
    counter: SourceCounter,
    /// Drawn since the start: neither a battery reset nor another pack changes it.
    drawn: Consumption,
    /// The latest known current, in amperes, with its time: a reading may come without one.
    last_current: Option<(Instant, f32)>,
}

/// Contribution of a reading to the consumption.
#[derive(Clone, Copy, Debug, Default)]
pub struct Count {
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

impl ChargeCounter {
    /// Takes a reading, with what is known of the pack's gauge.
    pub fn update(&mut self, now: Instant, measurement: &Measurement, gauge: &GaugeState) -> Count {
        match measurement.counted {
            Some(Counted::Increment(consumed)) => self.add_counted(consumed),
            // A tank's millilitres are counted as a pack's milliampere-hours.
            Some(Counted::Volume(volume_ml)) => self.add_counted(Consumed::charge(volume_ml)),
            Some(Counted::Total(total)) => match self.counter.total(total) {
                None => {
                    self.consumption.restart(total);
                    Count::at_source(0.0)
                }
                Some(increase) => self.add_counted(increase),
            },
            Some(Counted::TotalCharge(total_mah)) => {
                self.integrate_energy(now, measurement);
                match self.counter.total(Consumed::charge(total_mah)) {
                    None => {
                        self.consumption.set_charge_mah(total_mah);
                        Count::at_source(0.0)
                    }
                    Some(increase) => self.add_counted(increase),
                }
            }
            Some(Counted::Members { consumed, drawn_mah }) => {
                self.consumption.restart(consumed);
                let Some(charge_mah) = self.counter.members(measurement, drawn_mah) else {
                    return Count::default();
                };
                self.drawn.add_counted(Consumed::charge(charge_mah));
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
                if let Some(increase) = self.counter.total(Consumed::charge(charge_mah)) {
                    self.drawn.add_counted(increase);
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
        let current_a = measurement.rate()?;
        let (last, last_a) = self.last_current?;
        let Measurement {
            voltage_v, power_w, ..
        } = *measurement;
        self.consumption
            .integrate(now.us_since(last), last_a, current_a, voltage_v, power_w)
    }

    /// The current of a reading, from which the next interval is integrated.
    pub fn remember(&mut self, now: Instant, current_a: Option<f32>) {
        let known = current_a.map(|current_a| (now, current_a));
        self.last_current = known.or(self.last_current);
    }

    /// Adds to `reading` what the source has counted beyond its current.
    pub fn correct(&mut self, reading: &mut Reading, counted_mah: f32, is_measured: bool) {
        self.counter.correct(reading, counted_mah, is_measured);
    }

    /// The most that a count at the source leaves of the larger of these capacities, from 0 to 1.
    pub fn soc_at_most(&self, capacities_mah: [Option<f32>; 2]) -> f32 {
        if !self.counter.has_counted() {
            return 1.0;
        }
        let largest = capacities_mah.into_iter().flatten().reduce(f32::max);
        largest.map_or(1.0, |capacity_mah| self.soc_left(capacity_mah))
    }

    /// Share of this capacity that is left, from 0 to 1.
    pub fn soc_left(&self, capacity_mah: f32) -> f32 {
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

    /// The current before is not one of this interval.
    pub fn end_interval(&mut self) {
        self.last_current = None;
    }

    /// A count that ran backwards restarts at 0.
    pub fn discard_negative(&mut self) {
        if self.charge_mah() < 0.0 {
            self.restart(Consumed::default());
        }
    }

    /// The pack was swapped.
    pub fn replace_pack(&mut self) {
        self.consumption = Consumption::default();
        self.counter.rebase();
        // The time without a pack was not measured of this one.
        self.last_current = None;
    }

    /// Restarts at `consumed`.
    pub fn restart(&mut self, consumed: Consumed) {
        self.consumption.restart(consumed);
        self.counter.rebase();
    }

    /// The part to retain over a reset of the processor.
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

/// Steps of a counter, in milliampere-hours: BATTERY_STATUS and motor controllers count whole ones.
const STEP_MAH: f32 = 1.0;

/// A counter that falls below this share of what it was has restarted. One that falls less follows a braking motor, or a
/// frame that was overtaken: it counts again above its maximum.
const RESTARTED_BELOW: f32 = 0.5;

const MAH_PER_COULOMB: f32 = 1.0 / 3.6;

/// A total at the source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Total {
    /// Not read yet: what it has counted so far was drawn from this pack.
    #[default]
    Unread,
    /// The next one is where counting goes on: what it has counted so far is known, or was drawn from the pack before.
    Rebased,
    /// The highest since it started.
    At(f32),
}

impl Total {
    fn increase(&mut self, total: f32) -> f32 {
        match *self {
            Self::At(highest) if total <= highest && total >= RESTARTED_BELOW * highest => 0.0,
            Self::At(highest) => {
                *self = Self::At(total);
                (total - highest).max(0.0)
            }
            Self::Unread | Self::Rebased => {
                *self = Self::At(total);
                0.0
            }
        }
    }
}

/// The counter of one pack's source.
#[derive(Clone, Copy, Debug, Default)]
struct SourceCounter {
    charge: Total,
    energy: Total,
    /// A sum's members, and the latest of what was drawn from them, which may fall.
    drawn_mah: Option<(u16, f32)>,
    /// Charge counted beyond the measured current, in milliampere-hours; negative by up to a step, of a sum by more:
    /// its members are counted less often than it is.
    ahead_mah: f32,
    progress: Progress,
}

/// Whether the source counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Progress {
    /// Nothing was read of a counter.
    #[default]
    None,
    /// It has always stood still, which says nothing about an unknown current.
    StandsStill,
    Counts,
}

impl SourceCounter {
    /// Goes on from the next total: the pack was swapped, or its charge was set.
    pub fn rebase(&mut self) {
        *self = Self {
            charge: Total::Rebased,
            energy: Total::Rebased,
            ..Self::default()
        };
    }

    /// Whether there is one.
    pub fn has_counted(&self) -> bool {
        self.progress != Progress::None
    }

    /// Takes the totals of a reading. A total that falls is a restart of the source. Returns what was drawn since the reading
    /// before; `None` at the first one, whose totals were drawn before.
    pub fn total(&mut self, total: Consumed) -> Option<Consumed> {
        let is_first = self.charge == Total::Unread;
        let increase = Consumed {
            charge_mah: self.charge.increase(total.charge_mah),
            energy_wh: self.energy.increase(total.energy_wh),
        };
        (!is_first).then_some(increase)
    }

    /// Takes what was drawn from a sum's members since the start. Returns what was drawn since the reading before, which
    /// includes the time in which the current was unknown. Where the current counted instead, or the members are others,
    /// counting restarts from 0.
    pub fn members(&mut self, measurement: &Measurement, drawn_mah: Option<f32>) -> Option<f32> {
        let Some(drawn_mah) = drawn_mah else {
            if measurement.current_a.is_some() {
                self.drawn_mah = None;
            }
            return None;
        };
        let members = measurement.members;
        match self.drawn_mah.replace((members, drawn_mah)) {
            Some((before, before_mah)) if before == members => Some(drawn_mah - before_mah),
            _ => {
                self.ahead_mah = 0.0;
                Some(0.0)
            }
        }
    }

    /// Corrects a reading by the charge that was counted since the one before, in milliampere-hours. `is_measured`: its
    /// mean current is that of a sensor, without a gap. The larger of the two counts.
    pub fn correct(&mut self, reading: &mut Reading, counted_mah: f32, is_measured: bool) {
        if counted_mah != 0.0 {
            self.progress = Progress::Counts;
        } else if self.progress == Progress::None {
            self.progress = Progress::StandsStill;
        }
        match reading.mean_current_a {
            Some(mean_a) if is_measured => {
                let measured_mah = mean_a * reading.dt_s * MAH_PER_COULOMB;
                // A counter that does not count down stands still while a charger does its work.
                if measured_mah >= 0.0 {
                    let lowest_mah = self.drawn_mah.map_or(-STEP_MAH, |_| f32::NEG_INFINITY);
                    let ahead_mah = (self.ahead_mah + counted_mah - measured_mah).max(lowest_mah);
                    reading.unmeasured_mah = ahead_mah.max(0.0);
                    self.ahead_mah = ahead_mah.min(0.0);
                }
            }
            _ if self.progress != Progress::Counts => {}
            _ if reading.dt_s > 0.0 => {
                reading.missed_s = 0.0;
                reading.mean_current_a = Some(counted_mah / (reading.dt_s * MAH_PER_COULOMB));
            }
            _ => reading.unmeasured_mah = counted_mah,
        }
    }
}

/// A gauge that has not reported for longer has timed out, in microseconds: more than two of the slowest period of
/// batteries, 5 s.
const TIMEOUT_US: u64 = 12_000_000;

/// Whether what counts the charge, and has been silent `since` then, has timed out.
pub fn has_timed_out(since: Instant, now: Instant) -> bool {
    now.us_since(since) > TIMEOUT_US
}

/// Knowledge of the gauge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum GaugeState {
    /// There is none, or it is not to be used.
    #[default]
    Absent,
    /// It has not reported yet.
    Awaited { since: Instant },
    /// It has not reported in time: the source has none after all.
    NeverHeard,
    /// Its latest report is valid.
    Valid { gauge: Gauge, at: Instant },
    /// It has timed out. Its full capacity stays as it was.
    TimedOut { full_mah: f32 },
}

impl GaugeState {
    /// Takes what a reading at `now` says of it.
    pub fn update(&mut self, now: Instant, reading: GaugeReading) {
        let is_over = |since| has_timed_out(since, now);
        *self = match (reading, *self) {
            (GaugeReading::Absent, _) => Self::Absent,
            (GaugeReading::Read(gauge), _) => Self::Valid { gauge, at: now },
            (GaugeReading::Missing, Self::Absent) => Self::Awaited { since: now },
            (GaugeReading::Missing, Self::Awaited { since }) if is_over(since) => Self::NeverHeard,
            (GaugeReading::Missing, Self::Valid { gauge, at }) if is_over(at) => Self::TimedOut {
                full_mah: gauge.full_mah,
            },
            (GaugeReading::Missing, unchanged) => unchanged,
        };
    }

    /// Its report, until it has timed out.
    pub fn valid(&self) -> Option<&Gauge> {
        match self {
            Self::Valid { gauge, .. } => Some(gauge),
            _ => None,
        }
    }

    /// The pack's full capacity, in milliampere-hours, once it was reported.
    pub fn full_mah(&self) -> Option<f32> {
        match self {
            Self::Valid { gauge, .. } => Some(gauge.full_mah),
            Self::TimedOut { full_mah } => Some(*full_mah),
            Self::Absent | Self::Awaited { .. } | Self::NeverHeard => None,
        }
    }
}
