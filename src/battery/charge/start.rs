//! The first estimate of a pack whose current is measured.

use super::block::{Block, HOURS_PER_SECOND, Load};
use super::cell_model::{Capacity, CellModel};
use super::filter::Filter;
use super::memory::remembered;
use super::second::Sum;

/// Time at the very start whose voltage is kept, in seconds: a load that begins only then lowers it.
const FIRST_S: f32 = 0.25;

/// Under load the voltage is averaged for this long, in seconds.
const AVERAGING_S: f32 = 60.0;

/// From here on the average is reported, in seconds.
const FIRST_AVERAGE_S: f32 = 3.0;

/// Maximum current at rest, in capacities per hour.
const RESTING_RATE_PER_H: f32 = 0.1;

/// Mean current of the last minutes, in capacities per hour, from which on a pack was charged: more than a sensor's offset.
const CHARGED_RATE_PER_H: f32 = 0.05;

/// Maximum change of the voltage of a cell at rest from one second to the next, in volts.
const RESTING_CHANGE_V: f32 = 0.006;

/// A rested cell's voltage stays within this for this long, in volts and seconds: after a load it still rises.
const RESTED_CHANGE_V: f32 = 0.004;
const RESTED_S: f32 = 20.0;

/// A voltage that says more than that of any rest is believed after this time, in seconds.
const CONFIRMED_S: f32 = 1.5;

/// At rest from here on the pack was charged and not used since: chargers end within 1 % of 4.2 V a cell, which then
/// relaxes by some 30 mV.
const FULL_SHARE: f32 = 0.95;

/// From here on a voltage is certain: only charging brings it there.
const CERTAIN_SHARE: f32 = 0.90;
const CERTAIN_SIGMA: f32 = 0.01;

/// A curve on which a voltage gives the charge to this standard deviation is steep.
const STEEP_SIGMA: f32 = 0.12;

/// Gathers what the first estimate is made from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    elapsed_s: f32,
    /// Highest voltage of the pack in its first quarter of a second, in volts.
    first_v: Option<f32>,
    averaged_s: f32,
    cell_v: Sum,
    current_a: Sum,
    before_v: Option<f32>,
    /// The voltage of a cell that a rest keeps to, in volts, and for how long, in seconds.
    rest_v: f32,
    rested_s: f32,
    /// The highest estimate of a rest, less what was drawn since.
    at_rest: Option<Filter>,
    provisional: Option<Filter>,
}

/// A first estimate.
#[derive(Clone, Copy, Debug)]
pub(super) enum Found {
    /// The cells have rested.
    Rested(Filter),
    /// The load before is unknown.
    UnderLoad(Filter),
}

impl Start {
    /// Nothing yet.
    pub const NEW: Self = Self {
        elapsed_s: 0.0,
        first_v: None,
        averaged_s: 0.0,
        cell_v: Sum::NEW,
        current_a: Sum::NEW,
        before_v: None,
        rest_v: 0.0,
        rested_s: 0.0,
        at_rest: None,
        provisional: None,
    };

    /// Takes a reading of the pack.
    pub fn add(&mut self, dt_s: f32, voltage_v: Option<f32>) {
        self.elapsed_s += dt_s;
        if self.elapsed_s <= FIRST_S || self.first_v.is_none() {
            self.first_v = match (self.first_v, voltage_v) {
                (Some(first_v), Some(voltage_v)) => Some(first_v.max(voltage_v)),
                (first_v, voltage_v) => first_v.or(voltage_v),
            };
        }
    }

    /// An estimate that may still be too low: the cells have not rested for long, or are under load.
    pub fn provisional(&self) -> Option<&Filter> {
        self.provisional.as_ref()
    }

    /// Takes the load and voltage of a second. Returns the estimate, once there is one.
    pub fn update(
        &mut self,
        load: &Load,
        cell_v: f32,
        model: &CellModel,
        capacity: &Capacity,
    ) -> Option<Found> {
        let before_v = self.before_v.replace(cell_v);
        let is_stable = before_v.is_none_or(|before_v| (cell_v - before_v).abs() < RESTING_CHANGE_V);
        self.averaged_s += load.duration_s;
        self.cell_v.add(load.duration_s, cell_v);
        self.current_a.add(load.duration_s, load.current_a);
        if is_stable && is_resting(load.current_a, capacity) {
            let rested = self.rest(load, cell_v, model, capacity);
            if rested.is_some() {
                return rested.map(Found::Rested);
            }
        } else {
            self.end_rest(load, capacity);
        }
        self.found_under_load(model, capacity).map(Found::UnderLoad)
    }

    /// Returns the estimate of a pack that has rested.
    fn rest(&mut self, load: &Load, cell_v: f32, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        if (cell_v - self.rest_v).abs() > RESTED_CHANGE_V {
            self.rest_v = cell_v;
            self.rested_s = 0.0;
        }
        self.rested_s += load.duration_s;
        let by_voltage = Filter::from_voltage(load, cell_v, model, capacity);
        let known = certain(&by_voltage, model, capacity).or_else(|| remembered(cell_v, model, capacity));
        let found = known.unwrap_or(by_voltage);
        if self.rested_s >= known.map_or(RESTED_S, |_| CONFIRMED_S) {
            return Some(found);
        }
        let is_higher = |before: &Filter| found.share() > before.share();
        if self.at_rest.as_ref().is_none_or(is_higher) {
            self.at_rest = Some(found);
        }
        None
    }

    fn end_rest(&mut self, load: &Load, capacity: &Capacity) {
        self.rested_s = 0.0;
        if let Some(at_rest) = &mut self.at_rest {
            at_rest.draw(load.drawn_ah() / capacity.ah);
        }
    }

    fn found_under_load(&mut self, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        let first = self.first(model, capacity);
        if let Some(certain) = first.and_then(|first| certain(&first, model, capacity)) {
            return Some(self.drawn_since(certain, capacity));
        }
        let highest = self.highest(first, model, capacity)?;
        if self.averaged_s >= AVERAGING_S {
            return Some(highest);
        }
        let is_averaged = self.averaged_s >= FIRST_AVERAGE_S;
        self.provisional = self.at_rest.or(is_averaged.then_some(highest));
        None
    }

    /// By the voltage in the first moment.
    fn first(&self, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        let (first_v, count) = self.first_v.zip(model.cell_count)?;
        Some(Filter::from_voltage(
            &Load::NONE,
            first_v / f32::from(count),
            model,
            capacity,
        ))
    }

    /// The estimate now, after one of the first moment.
    fn drawn_since(&self, mut first: Filter, capacity: &Capacity) -> Filter {
        first.draw(self.current_a.integral() * HOURS_PER_SECOND / capacity.ah);
        first
    }

    /// A load only lowers the voltage: of several estimates the highest counts.
    fn highest(&self, first: Option<Filter>, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        let current_a = self.current_a.mean(self.averaged_s)?;
        let load = Load {
            duration_s: self.averaged_s,
            current_a,
            slow_a: current_a,
        };
        let drawn = load.drawn_ah() / capacity.ah;
        let mut averaged = Filter::from_voltage(&load, self.cell_v.mean(self.averaged_s)?, model, capacity);
        averaged.draw(0.5 * drawn);
        let first = first.map(|first| self.drawn_since(first, capacity));
        let others = first.into_iter().chain(self.at_rest);
        Some(others.fold(averaged, |highest, other| {
            if other.share() > highest.share() {
                other
            } else {
                highest
            }
        }))
    }
}

/// Whether a current is that of a pack at rest.
pub(super) fn is_resting(current_a: f32, capacity: &Capacity) -> bool {
    current_a.abs() < RESTING_RATE_PER_H * capacity.ah
}

/// The estimate at the end of charging: the current has fallen at the voltage of a full pack.
pub(super) fn charged(block: &Block, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
    let was_charged = block.load.slow_a < -CHARGED_RATE_PER_H * capacity.ah;
    if !was_charged || !is_resting(block.load.current_a, capacity) {
        return None;
    }
    let by_voltage = Filter::from_voltage(&block.load, block.cell_v?, model, capacity);
    certain(&by_voltage, model, capacity).filter(|certain| certain.share() >= FULL_SHARE)
}

/// The estimate for a voltage that only charging brings about, unless the curve is flat there.
fn certain(by_voltage: &Filter, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
    let share = by_voltage.share();
    if share < CERTAIN_SHARE || by_voltage.sigma() > STEEP_SIGMA {
        return None;
    }
    let share = if share >= FULL_SHARE { 1.0 } else { share };
    Some(Filter::from_share(share, CERTAIN_SIGMA, model, capacity))
}
