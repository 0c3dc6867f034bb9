//! Charge and energy drawn from a pack, wherever they are counted: here, at the source, or by the pack's own fuel gauge.

use super::source_counter::SourceCounter;
use crate::charge::{ChargeEstimate, KnownCharge, SILENCE_S};
use crate::consumption::{Consumption, Gap, mean_current_a, microseconds, was_off};
use crate::estimator::Reading;
use crate::measurement::COULOMBS_PER_MAH;
use crate::time::Instant;
use crate::{Consumed, Counted, Gauge, GaugeReading, LoadState, Measurement};

/// Counts what is drawn from one pack.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChargeCounter {
    consumption: Consumption,
    counter: SourceCounter,
    /// Drawn since the start: neither a battery reset nor another pack changes it.
    drawn: Consumption,
    most: MostLeft,
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
    /// Takes a reading, `dt_s` seconds after the one before, with what is known of the pack's gauge and its capacity.
    pub fn update(
        &mut self,
        now: Instant,
        dt_s: f32,
        measurement: &Measurement,
        gauge: &GaugeState,
        capacity_mah: Option<f32>,
    ) -> Count {
        self.most.wait(dt_s);
        match measurement.counted {
            Some(Counted::Increment(consumed)) => self.add_counted(consumed),
            // A tank's millilitres are counted as a pack's milliampere-hours.
            Some(Counted::Volume(volume_ml)) => self.add_counted(Consumed::charge(volume_ml)),
            Some(Counted::Total(total)) => {
                let Consumed {
                    charge_mah,
                    energy_wh,
                } = total;
                match self
                    .counter
                    .total(charge_mah, Some(energy_wh), dt_s, capacity_mah)
                {
                    None => {
                        self.consumption.restart(total);
                        self.begin_at(charge_mah)
                    }
                    Some(increase) => self.add_counted(increase),
                }
            }
            Some(Counted::TotalCharge(total_mah)) => {
                let before_wh = self.energy_wh();
                self.integrate_energy(now, measurement);
                self.counter.add_integrated_wh(self.energy_wh() - before_wh);
                match self.counter.total(total_mah, None, dt_s, capacity_mah) {
                    None => {
                        self.consumption.set_charge_mah(total_mah);
                        self.begin_at(total_mah)
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
            None => self.count_here(now, dt_s, measurement, gauge),
        }
    }

    /// The first total, in milliampere-hours, was drawn from this pack, unless its rest denies it.
    fn begin_at(&mut self, total_mah: f32) -> Count {
        self.most.begin(self.drawn_mah(), total_mah);
        Count::at_source(0.0)
    }

    fn add_counted(&mut self, consumed: Consumed) -> Count {
        self.consumption.add_counted(consumed);
        self.drawn.add_counted(consumed);
        Count::at_source(consumed.charge_mah)
    }

    /// Integrates the current; the charge is a gauge's, where there is one.
    fn count_here(
        &mut self,
        now: Instant,
        dt_s: f32,
        measurement: &Measurement,
        gauge: &GaugeState,
    ) -> Count {
        if gauge.full_mah().is_some() {
            // A gap does not matter.
            self.integrate_energy(now, measurement);
            if let Some(gauge) = gauge.valid() {
                let charge_mah = gauge.consumed_mah();
                self.consumption.set_charge_mah(charge_mah);
                if let Some(increase) = self.counter.total(charge_mah, None, dt_s, Some(gauge.full_mah)) {
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
        let dt_us = now.us_since(last);
        let Measurement {
            voltage_v, power_w, ..
        } = *measurement;
        if was_off(measurement.contents, dt_us) {
            return None;
        }
        self.consumption
            .integrate(dt_us, last_a, current_a, voltage_v, power_w)
    }

    /// Completes a reading whose current is known by the charge of the readings before it that came without one, which is
    /// assumed as [`integrate`](Self::integrate) does.
    pub fn complete(&self, now: Instant, dt_us: u64, reading: &mut Reading) {
        let (Some((known_at, before_a)), Some(current_a)) = (self.last_current, reading.current_a) else {
            return;
        };
        let since_us = now.us_since(known_at);
        if since_us <= dt_us {
            return;
        }
        if let Some(mean_a) = mean_current_a(since_us, Some(before_a), current_a) {
            let unknown_s = microseconds(since_us - dt_us) * 1e-6;
            reading.unmeasured_mah += mean_a.max(0.0) * unknown_s / COULOMBS_PER_MAH;
            reading.missed_s += unknown_s;
        }
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

    /// The most that a count at the source leaves of a pack with this capacity, from 0 to 1; `None` if the source does not
    /// count.
    pub fn soc_at_most(&self, capacity_mah: Option<f32>) -> Option<f32> {
        self.counter.exists().then(|| {
            if self.awaits_rest() {
                1.0
            } else {
                self.most.soc(self.drawn_mah(), capacity_mah)
            }
        })
    }

    /// Whether the source counts: its current is not needed.
    pub fn source_counts(&self) -> bool {
        self.counter.counts()
    }

    /// Whether a first total may have been drawn from another pack: until this one has rested, at most for some seconds,
    /// nothing is known of its charge.
    pub fn awaits_rest(&self) -> bool {
        self.most.awaits_rest()
    }

    /// Takes the estimate of a second, if there is one, of a pack with this capacity.
    pub fn follow_estimate(
        &mut self,
        estimate: Option<&ChargeEstimate>,
        load_state: LoadState,
        capacity_mah: Option<f32>,
    ) {
        let drawn_mah = self.drawn_mah();
        self.most.follow(estimate, load_state, drawn_mah, capacity_mah);
    }

    /// A measured current has charged the pack, in milliampere-hours.
    pub fn add_charged(&mut self, charged_mah: f32, capacity_mah: Option<f32>) {
        let drawn_mah = self.drawn_mah();
        self.most.charge(charged_mah, drawn_mah, capacity_mah);
    }

    /// Another component counts from now on: its total is not this pack's consumption.
    pub fn change_source(&mut self) {
        self.counter = SourceCounter::of_another_source();
    }

    /// Share of this capacity that is left, from 0 to 1.
    pub fn soc_left(&self, capacity_mah: f32) -> f32 {
        (1.0 - self.charge_mah() / capacity_mah).clamp(0.0, 1.0)
    }

    /// Since the start or the last battery reset, in milliampere-hours.
    pub fn charge_mah(&self) -> f32 {
        self.consumption.charge_mah()
    }

    /// Energy drawn since the start or the last battery reset, in watt-hours.
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
            self.consumption = Consumption::default();
            self.counter.rebase();
        }
    }

    /// The pack was swapped.
    pub fn replace_pack(&mut self) {
        self.consumption = Consumption::default();
        self.counter.rebase();
        self.most = MostLeft::unknown(self.drawn_mah());
        // The time without a pack was not measured of this one.
        self.last_current = None;
    }

    /// Restarts at `consumed`, with this charge left, from 0 to 1.
    pub fn restart(&mut self, consumed: Consumed, soc: f32) {
        self.consumption.restart(consumed);
        self.counter.rebase();
        self.most.set(&KnownCharge::set(soc), self.drawn_mah());
    }

    /// The part to retain over a reset of the processor.
    pub fn consumption(&self) -> Consumption {
        self.consumption
    }

    /// Continues with what was retained, and the charge that was left.
    pub fn restore(&mut self, consumption: Consumption, left: Option<&KnownCharge>) {
        self.consumption = consumption;
        if consumption != Consumption::default() {
            self.counter.rebase();
        }
        if let Some(left) = left {
            self.most.set(left, self.drawn_mah());
        }
    }
}

/// For how long a first total is compared with the pack's rest before a charge is estimated by it, in seconds.
const REST_WITHIN_S: f32 = 10.0;

/// The most that may be left of a pack whose source counts: what it had at most, less what was counted since.
#[derive(Clone, Copy, Debug)]
struct MostLeft {
    /// From 0 to 1, when `drawn_mah` had been drawn since the start.
    soc: f32,
    drawn_mah: f32,
    base: Base,
}

/// Knowledge of what a pack had at most.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Base {
    /// It may have been full.
    Unknown,
    /// It was full when its source began to count, for all that is known for this long, in seconds.
    Assumed(f32),
    /// It had more than was left by the count: until there is a load its rest shows how much.
    Denied,
    /// It was estimated or set.
    Known,
}

impl Default for MostLeft {
    fn default() -> Self {
        Self::unknown(0.0)
    }
}

impl MostLeft {
    fn unknown(drawn_mah: f32) -> Self {
        Self {
            soc: 1.0,
            drawn_mah,
            base: Base::Unknown,
        }
    }

    /// The source had counted this much when it was read first.
    fn begin(&mut self, drawn_mah: f32, total_mah: f32) {
        if self.base == Base::Unknown && total_mah > 0.0 {
            self.drawn_mah = drawn_mah - total_mah;
            self.base = Base::Assumed(0.0);
        }
    }

    fn wait(&mut self, dt_s: f32) {
        if let Base::Assumed(waited_s) = &mut self.base {
            *waited_s += dt_s;
        }
    }

    fn awaits_rest(&self) -> bool {
        matches!(self.base, Base::Assumed(_))
    }

    /// This charge is left.
    fn set(&mut self, charge: &KnownCharge, drawn_mah: f32) {
        *self = Self {
            soc: charge.highest(),
            drawn_mah,
            base: Base::Known,
        };
    }

    fn soc(&self, drawn_mah: f32, capacity_mah: Option<f32>) -> f32 {
        let share = capacity_mah.map_or(0.0, |capacity_mah| (drawn_mah - self.drawn_mah) / capacity_mah);
        (self.soc - share).clamp(0.0, 1.0)
    }

    /// A pack that rests with the load off shows what it has: more than was counted if it was charged, or if another one was counted.
    fn follow(
        &mut self,
        estimate: Option<&ChargeEstimate>,
        load_state: LoadState,
        drawn_mah: f32,
        capacity_mah: Option<f32>,
    ) {
        if load_state == LoadState::On {
            self.base = Base::Known;
            return;
        }
        // By then the voltage shows no load that was switched off.
        let has_waited = matches!(self.base, Base::Assumed(waited_s) if waited_s >= REST_WITHIN_S);
        if let Some(estimate) = estimate.filter(|estimate| estimate.rests || has_waited) {
            let shown = &estimate.by_itself;
            let most = self.soc(drawn_mah, capacity_mah);
            let is_denied = self.base == Base::Denied || shown.lowest() > most;
            if is_denied || self.base != Base::Known && shown.highest() < most {
                self.set(shown, drawn_mah);
            }
            self.base = if is_denied { Base::Denied } else { Base::Known };
        } else if has_waited {
            self.base = Base::Known;
        }
    }

    /// The pack was charged by a measured current.
    fn charge(&mut self, charged_mah: f32, drawn_mah: f32, capacity_mah: Option<f32>) {
        let full_at_mah = capacity_mah.map_or(f32::INFINITY, |capacity_mah| {
            drawn_mah + (1.0 - self.soc) * capacity_mah
        });
        self.drawn_mah = (self.drawn_mah + charged_mah)
            .min(full_at_mah)
            .max(self.drawn_mah);
    }
}

/// A gauge that has not reported for longer has timed out, in microseconds.
pub const TIMEOUT_US: u64 = (SILENCE_S * 1e6) as u64;

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
