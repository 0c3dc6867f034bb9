//! Load of a cell: means over a second and over ten, the rest of earlier loads, and the sag of the voltage.
//!
//! All that follows a second runs once a second, at any sampling rate.

use super::cell_model::{CellModel, root_of_squares};
use crate::VoltageSource;
use crate::learnt::Collapse;
use crate::low_pass::MeanThenLowPass;

/// Duration of a second, less what the sampling interval may vary, in seconds.
const SECOND_S: f32 = 0.999;

/// The very first one is shorter, in seconds: there is an estimate soon after the start.
const FIRST_SECOND_S: f32 = 0.249;

/// A counter of a pack has been lost after this time, in seconds: more than two of the slowest period of
/// batteries, 5 s.
pub const SILENCE_S: f32 = 12.0;

/// Origin of a current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentOrigin {
    Sensor,
    /// A counter at the source, which need not count what charges the pack.
    SourceCounter,
}

/// Sums up to a second.
#[derive(Clone, Copy, Debug)]
pub struct Gathering {
    complete_s: f32,
    duration_s: f32,
    voltage: MeasuredSum,
    current: MeasuredSum,
    unread: Unread,
}

/// Charge of a time that the current does not show, in ampere-hours.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unread {
    /// Counted by the source beyond this current.
    pub unmeasured_ah: f32,
    /// Part of the current's charge that was assumed, as readings are missing.
    pub assumed_ah: f32,
    /// Part of it that was at least that much: the current was over its sensor's range.
    pub over_range_ah: f32,
}

/// A sum over most of a second.
#[derive(Clone, Copy, Debug)]
struct MeasuredSum {
    value_s: f32,
    missing_s: f32,
}

/// A weighted sum of what was measured.
#[derive(Clone, Copy, Debug)]
pub struct Sum {
    value_s: f32,
    duration_s: f32,
}

/// Means over a second, or over the sampling interval if that is longer. `None` is not measured.
#[derive(Clone, Copy, Debug)]
pub struct Second {
    /// In seconds.
    pub duration_s: f32,
    /// Of the whole pack, in volts.
    pub voltage_v: Option<f32>,
    /// In amperes.
    pub current_a: Option<f32>,
    /// Origin of the latest.
    pub origin: CurrentOrigin,
    /// Charge that this current does not show.
    pub unread: Unread,
}

impl Sum {
    /// Nothing yet.
    pub const NEW: Self = Self {
        value_s: 0.0,
        duration_s: 0.0,
    };

    pub fn add(&mut self, dt_s: f32, value: f32) {
        self.value_s += value * dt_s;
        self.duration_s += dt_s;
    }

    /// The integral, in units of the value times seconds.
    pub fn integral(&self) -> f32 {
        self.value_s
    }

    /// The mean, if at least half of `duration_s` is covered.
    pub fn mean(&self, duration_s: f32) -> Option<f32> {
        let is_covered = self.duration_s > 0.0 && self.duration_s >= 0.5 * duration_s;
        is_covered.then(|| self.value_s / self.duration_s)
    }
}

impl MeasuredSum {
    const NEW: Self = Self {
        value_s: 0.0,
        missing_s: 0.0,
    };

    fn add(&mut self, dt_s: f32, value: Option<f32>) {
        match value {
            Some(value) => self.value_s += value * dt_s,
            None => self.missing_s += dt_s,
        }
    }

    /// The mean, if at least half of `duration_s` was measured.
    fn mean(&self, duration_s: f32) -> Option<f32> {
        let measured_s = duration_s - self.missing_s;
        (measured_s > 0.0 && measured_s >= 0.5 * duration_s).then(|| self.value_s / measured_s)
    }
}

impl Gathering {
    /// Nothing yet.
    pub const NEW: Self = Self::complete_at(FIRST_SECOND_S);

    /// Delays the end of the first one.
    pub fn delay(&mut self, delay_s: f32) {
        self.complete_s += delay_s;
    }

    const fn complete_at(complete_s: f32) -> Self {
        Self {
            complete_s,
            duration_s: 0.0,
            voltage: MeasuredSum::NEW,
            current: MeasuredSum::NEW,
            unread: Unread {
                unmeasured_ah: 0.0,
                assumed_ah: 0.0,
                over_range_ah: 0.0,
            },
        }
    }

    /// Takes a charge that the current does not show.
    pub fn add_unread(&mut self, more: &Unread) {
        self.unread.unmeasured_ah += more.unmeasured_ah;
        self.unread.assumed_ah += more.assumed_ah;
        self.unread.over_range_ah += more.over_range_ah;
    }

    /// Takes a reading; returns the means once a second is complete.
    pub fn add(
        &mut self,
        dt_s: f32,
        voltage_v: Option<f32>,
        current_a: Option<f32>,
        origin: CurrentOrigin,
    ) -> Option<Second> {
        self.duration_s += dt_s;
        self.voltage.add(dt_s, voltage_v);
        self.current.add(dt_s, current_a);
        if self.duration_s < self.complete_s {
            return None;
        }
        let complete = core::mem::replace(self, Self::complete_at(SECOND_S));
        Some(Second {
            duration_s: complete.duration_s,
            voltage_v: complete.voltage.mean(complete.duration_s),
            current_a: complete.current.mean(complete.duration_s),
            origin,
            unread: complete.unread,
        })
    }
}

/// Duration of a block, less what a second may vary, in seconds.
const BLOCK_S: f32 = 9.99;

pub const HOURS_PER_SECOND: f32 = 1.0 / 3600.0;

/// A load of a cell over some time.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    /// In seconds.
    pub duration_s: f32,
    /// Mean, in amperes.
    pub current_a: f32,
    /// Mean of what is left of earlier loads, in amperes
    /// ([`Polarisation::current_a`]).
    pub slow_a: f32,
}

/// A quantity of an explanation, with its unit; its value; its standard deviation, where it has one.
pub type Quantity = (&'static str, f32, Option<f32>);

/// Means over a block.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    pub load: Load,
    /// Of a cell, in volts, if measured.
    pub cell_v: Option<f32>,
}

/// Sums up to a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockSum {
    cell_v: Sum,
    current_a: Sum,
    slow_a: Sum,
    duration_s: f32,
}

impl Load {
    /// No load, neither now nor before.
    pub const NONE: Self = Self::none_for(0.0);

    /// No load for some time.
    pub const fn none_for(duration_s: f32) -> Self {
        Self {
            duration_s,
            current_a: 0.0,
            slow_a: 0.0,
        }
    }

    /// The voltage it takes off a cell with this resistance and slow share, in volts.
    pub fn sag_v(&self, ohm: f32, slow_share: f32) -> f32 {
        ohm * (self.current_a + slow_share * self.slow_a)
    }

    /// Charge drawn, in ampere-hours.
    pub fn drawn_ah(&self) -> f32 {
        self.current_a * self.duration_s * HOURS_PER_SECOND
    }
}

impl BlockSum {
    /// Nothing yet.
    pub const NEW: Self = Self {
        cell_v: Sum::NEW,
        current_a: Sum::NEW,
        slow_a: Sum::NEW,
        duration_s: 0.0,
    };

    /// Takes a second; returns the block, once it is complete.
    pub fn add(&mut self, load: &Load, cell_v: Option<f32>) -> Option<Block> {
        self.duration_s += load.duration_s;
        self.current_a.add(load.duration_s, load.current_a);
        self.slow_a.add(load.duration_s, load.slow_a);
        if let Some(cell_v) = cell_v {
            self.cell_v.add(load.duration_s, cell_v);
        }
        if self.duration_s < BLOCK_S {
            return None;
        }
        let complete = core::mem::replace(self, Self::NEW);
        Some(Block {
            load: Load {
                duration_s: complete.duration_s,
                current_a: complete.current_a.mean(complete.duration_s)?,
                slow_a: complete.slow_a.mean(complete.duration_s)?,
            },
            cell_v: complete.cell_v.mean(complete.duration_s),
        })
    }

    /// Charge drawn since the last block, in ampere-hours.
    pub fn drawn_ah(&self) -> f32 {
        self.current_a.integral() * HOURS_PER_SECOND
    }
}

/// Time constants, in seconds, and the share of each in the slow sag. Steps of the sag of an 18650 cell reach 1, 1.5, 1.9
/// and 3.1 times the fast one within 1, 10, 100 and 1000 s.
const PARTS: [(f32, f32); 3] = [(10.0, 0.25), (100.0, 0.25), (1000.0, 0.5)];

/// Weighted low-passes of the current.
#[derive(Clone, Copy, Debug)]
pub struct Polarisation([MeanThenLowPass; 3]);

impl Polarisation {
    /// Unknown: until it is as old as its time constant, each part is the mean of the current so far.
    pub const fn unknown() -> Self {
        let [(fast_s, _), (middle_s, _), (slow_s, _)] = PARTS;
        Self([
            MeanThenLowPass::new(fast_s),
            MeanThenLowPass::new(middle_s),
            MeanThenLowPass::new(slow_s),
        ])
    }

    /// The cells have rested.
    pub fn at_rest() -> Self {
        Self::steady(0.0)
    }

    /// The current was this for long, in amperes.
    pub fn steady(current_a: f32) -> Self {
        let mut polarisation = Self::unknown();
        for part in &mut polarisation.0 {
            part.initialise(current_a);
        }
        polarisation
    }

    /// Takes the mean current of `dt_s` seconds.
    pub fn update(&mut self, dt_s: f32, current_a: f32) {
        for part in &mut self.0 {
            part.update(dt_s, current_a);
        }
    }

    /// The current averaged over ten seconds, in amperes.
    pub fn recent_a(&self) -> Option<f32> {
        let [fast, ..] = &self.0;
        fast.value()
    }

    /// The current averaged over minutes, in amperes.
    pub fn mean_a(&self) -> Option<f32> {
        let [_, middle, _] = &self.0;
        middle.value()
    }

    /// The current averaged over the longest time, in amperes.
    pub fn lasting_a(&self) -> f32 {
        let [_, _, slow] = &self.0;
        slow.value().unwrap_or(0.0)
    }

    /// The current whose fast sag equals the slow one, for a slow share of 1, in amperes.
    pub fn current_a(&self) -> f32 {
        let parts = self.0.iter().zip(PARTS);
        parts
            .map(|(part, (_, share))| share * part.value().unwrap_or(0.0))
            .sum()
    }
}

/// State that outlives a change of the method.
#[derive(Clone, Copy, Debug)]
pub struct Trace {
    /// Of the current in amperes; of the load in capacities per hour where it is inferred from the voltage.
    pub polarisation: Polarisation,
    pub block: BlockSum,
    pub reserve: Reserve,
}

impl Trace {
    /// Nothing was seen of the load.
    pub const NEW: Self = Self {
        polarisation: Polarisation::unknown(),
        block: BlockSum::NEW,
        reserve: Reserve::NEW,
    };
}

/// The largest sag of the last hour is kept by intervals of this duration, in seconds.
const PEAK_INTERVAL_S: f32 = 600.0;
const PEAKS: usize = 6;

/// A voltage that is averaged over this number of seconds ends a drive.
const RECENT: usize = 10;

/// A cell that is this far above the end, in volts, at this share of the largest recent sag carries its load.
const CARRYING_V: f32 = 0.1;
const CARRYING_SAG: f32 = 0.75;

/// A load that has taken a cell to the end is expected to do so again for this time, in seconds.
const USED_UP_S: f32 = 3600.0;

/// A pack whose state of charge is that much higher again was charged, unseen by a current sensor: no rest corrects so much.
const RECHARGED: f32 = 0.4;

/// Usable charge until a load has taken a cell to the end, at least: before, a reserve is only expected.
const MIN_USABLE: f32 = 0.01;

/// Growth of the sag of the same load from this charge to the end, where the load is measured: impedances of Li-ion cells are much
/// the same down to 20 % and change at low charge (doi:10.3390/jlpea13020029). Its amount, and that it is linear, is assumed.
const GROWTH_NEAR_EMPTY: f32 = 1.5;
const GROWS_BELOW: f32 = 0.2;

/// Growth of the sag at any charge where the load is inferred from it.
const INFERRED_GROWTH: f32 = 0.2;

/// Standard deviation of the sag that ends a drive, relative to it: that of its growth, and of the peak. Assumed.
const RESERVE_SAG_SIGMA: f32 = 0.25;

/// Lower limit of what is used between full and the end, relative to the capacity.
const MIN_SPAN: f32 = 0.01;

/// Steps in which a reserve is searched: to half a percent.
const SEARCH_STEPS: u8 = 8;

/// Growth of a sag towards the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SagGrowth {
    /// It was taken from the resting voltage of a charge that is counted.
    NearEmpty,
    /// The charge was inferred from it.
    Inferred,
}

/// Growth of a sag from half charge to this state of charge from 0 to 1, relative to it.
fn near_empty(soc: f32) -> f32 {
    GROWTH_NEAR_EMPTY * (1.0 - soc / GROWS_BELOW).max(0.0)
}

impl SagGrowth {
    /// The sag at half charge of a load with this one at a state of charge from 0 to 1, in volts.
    fn at_half_charge_v(self, sag_v: f32, soc: f32, model: &CellModel) -> f32 {
        match self {
            Self::Inferred => sag_v,
            Self::NearEmpty => (sag_v / (1.0 + near_empty(soc))).max(sag_v - model.cell.max_growth_v),
        }
    }
}

/// The largest recent sag, and the charge at which it ends the drive.
#[derive(Clone, Copy, Debug)]
pub struct Reserve {
    /// The largest sag of each interval, the latest one first, and of all, in volts.
    peaks_v: [f32; PEAKS],
    peak_v: f32,
    /// Time in the latest interval, in seconds.
    interval_s: f32,
    soc: f32,
    /// Standard deviation of the share.
    sigma: f32,
    /// Voltages of a cell in the last seconds, the latest one first, in millivolts; 0: none.
    recent_mv: [u16; RECENT],
    /// Time since the load has taken a cell to the end, in seconds, and the state of charge then; `None` once one as large as any of
    /// the last hour is carried.
    used_up: Option<(f32, f32)>,
    /// Whether the load of the last measurement was carried.
    was_carried: bool,
}

impl Reserve {
    /// No load was seen.
    pub const NEW: Self = Self {
        peaks_v: [0.0; PEAKS],
        peak_v: 0.0,
        interval_s: 0.0,
        soc: 0.0,
        sigma: 0.0,
        recent_mv: [0; RECENT],
        used_up: None,
        was_carried: false,
    };

    /// Takes the voltage of a cell in a second of load: the mean of ten ends a drive.
    pub fn add(&mut self, cell_v: f32, soc: f32, model: &CellModel) {
        self.recent_mv.rotate_right(1);
        self.recent_mv[0] = (1e3 * cell_v) as u16;
        let sum_mv: u32 = self.recent_mv.iter().copied().map(u32::from).sum();
        let is_complete = !self.recent_mv.contains(&0);
        if is_complete && sum_mv as f32 * (1e-3 / RECENT as f32) < model.terminal_end_v() {
            self.used_up = Some((0.0, soc));
        }
    }

    /// Takes the voltage of a cell, averaged over ten seconds (`dt_s`) at this state of charge from 0 to 1. Returns whether its load
    /// was carried, in this time and the one before: when a load ends, a cell that collapsed recovers within one.
    pub fn update(&mut self, dt_s: f32, cell_v: f32, soc: f32, growth: SagGrowth, model: &CellModel) -> bool {
        let sag_v = growth.at_half_charge_v(model.voltage_v(soc) - cell_v, soc, model);
        self.interval_s += dt_s;
        if self.interval_s >= PEAK_INTERVAL_S {
            self.interval_s = 0.0;
            self.peaks_v.rotate_right(1);
            self.peaks_v[0] = 0.0;
        }
        self.peaks_v[0] = self.peaks_v[0].max(sag_v);
        self.peak_v = self.peaks_v.iter().copied().fold(0.0, f32::max);
        let end_v = model.terminal_end_v();
        let is_carried = sag_v >= CARRYING_SAG * self.peak_v && cell_v >= end_v + CARRYING_V;
        let stays_carried = is_carried && self.was_carried;
        self.used_up = self
            .used_up
            .map(|(since_s, at)| (since_s + dt_s, at))
            .filter(|(since_s, at)| soc < at + RECHARGED && !(stays_carried && *since_s >= USED_UP_S));
        self.was_carried = is_carried;
        stays_carried
    }

    /// Forgets the sags: the resting voltage from which they were taken was wrong.
    pub fn restart(&mut self) {
        *self = Self {
            used_up: self.used_up,
            recent_mv: self.recent_mv,
            ..Self::NEW
        };
    }

    /// Charge was taken in: the load may go on.
    pub fn charge(&mut self) {
        self.used_up = None;
    }

    /// See [`ChargeEstimator::explain`](super::ChargeEstimator::explain).
    pub fn explain(&self) -> [Quantity; 2] {
        [
            (
                "charge at which the load ends the drive, %",
                100.0 * self.soc,
                Some(100.0 * self.sigma),
            ),
            (
                "largest sag of a cell in the last hour, mV",
                1e3 * self.peak_v,
                None,
            ),
        ]
    }

    /// Computes the charge at which such a sag ends the drive: not below that of a collapse that is expected.
    pub fn compute(&mut self, growth: SagGrowth, collapse: Option<Collapse>, model: &CellModel) {
        let by_sag = self.reserve(model.terminal_end_v(), growth, model);
        let sigma_v = RESERVE_SAG_SIGMA * self.sag_v(by_sag, growth, model);
        (self.soc, self.sigma) = (by_sag, sigma_v / model.slope_v(by_sag));
        if model.end.source == VoltageSource::Resting {
            let by_resting = model.soc(model.end.cell_v);
            if by_resting >= by_sag {
                (self.soc, self.sigma) = (by_resting, 0.0);
            }
        }
        if let Some(collapse) = collapse {
            let soc = collapse.soc_at(model.known_ohm()).min(model.cell.max_reserve);
            if soc > self.soc {
                (self.soc, self.sigma) = (soc, RESERVE_SAG_SIGMA * soc);
            }
        }
    }

    /// The sag of the same load at this state of charge, in volts.
    fn sag_v(&self, soc: f32, growth: SagGrowth, model: &CellModel) -> f32 {
        match growth {
            SagGrowth::Inferred => self.peak_v * (1.0 + INFERRED_GROWTH),
            SagGrowth::NearEmpty => {
                let peak_v = self.peak_v;
                peak_v + (near_empty(soc) * peak_v).min(model.cell.max_growth_v)
            }
        }
    }

    /// The charge at which the sag takes a cell to this voltage.
    fn reserve(&self, end_v: f32, growth: SagGrowth, model: &CellModel) -> f32 {
        let (mut low, mut high) = (0.0_f32, model.cell.max_reserve);
        for _ in 0..SEARCH_STEPS {
            let middle = 0.5 * (low + high);
            if model.voltage_v(middle) - self.sag_v(middle, growth, model) < end_v {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// Usable charge at this state of charge, relative to the capacity, from 0 to 1.
    pub fn available(&self, soc: f32) -> f32 {
        if self.used_up.is_some() {
            return 0.0;
        }
        (soc - self.soc).max(MIN_USABLE.min(soc))
    }

    /// Usable charge relative to what the load can draw from a full pack, from 0 to 1.
    pub fn usable(&self, soc: f32) -> f32 {
        (self.available(soc) / self.span()).min(1.0)
    }

    /// Standard deviation of that, with this one of the state of charge.
    pub fn usable_sigma(&self, soc: f32, sigma: f32) -> f32 {
        let by_reserve = (1.0 - soc) / self.span() * self.sigma;
        (root_of_squares(sigma, by_reserve) / self.span()).min(1.0)
    }

    fn span(&self) -> f32 {
        (1.0 - self.soc).max(MIN_SPAN)
    }
}
