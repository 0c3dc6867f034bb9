//! The first estimate of a pack whose current is measured.

use super::cell_model::{Capacity, CellModel, KnownCharge, root_of_squares};
use super::filter::{Filter, STEEP_SIGMA, has_plateau};
use super::load::{Block, HOURS_PER_SECOND, Load, Polarisation, Sum};
use crate::LearntPack;
use crate::chemistry::SAME_VOLTAGE_V;
use crate::state::BOUND_SIGMAS;

/// Time at the very start whose voltage is kept, in seconds: of a load that began then only the immediate part of the sag
/// is in it.
const FIRST_S: f32 = 0.25;

/// Under load the voltage is averaged for this long, in seconds.
const AVERAGING_S: f32 = 60.0;

/// From here on the average is reported, in seconds.
const FIRST_AVERAGE_S: f32 = 3.0;

/// Maximum current at rest, in capacities per hour.
const RESTING_RATE_PER_H: f32 = 0.1;

/// Maximum current with the load off, and of its difference from that of the last seconds, in capacities per hour.
const MAX_IDLE_RATE_PER_H: f32 = 0.2;
const STEADY_RATE_PER_H: f32 = 0.02;

/// Mean current of the last minutes, in capacities per hour, from which on a pack was charged: more than a sensor's offset.
const CHARGED_RATE_PER_H: f32 = 0.05;

/// Maximum change of the voltage of a cell at rest from one second to the next, in volts.
const RESTING_CHANGE_V: f32 = 0.006;

/// A rested cell's voltage stays within this for this long, in volts and seconds: after a load it still rises.
const RESTED_CHANGE_V: f32 = 0.004;
const RESTED_S: f32 = 20.0;

/// A voltage that only a full cell keeps is kept after this time, in seconds, when a rest is evaluated for the first time.
const KEPT_S: f32 = 30.0;

/// A voltage that says more than that of any rest is believed after this time, in seconds.
const CONFIRMED_S: f32 = 1.5;

/// At rest from here on the pack was charged and not used since: chargers end within 1 % of 4.2 V a cell, which then
/// relaxes by some 30 mV.
const FULL_SOC: f32 = 0.95;

const CERTAIN_SIGMA: f32 = 0.01;

/// From here on, and the more so within this width, a voltage may be that of a cell that was charged a moment ago and has not relaxed. Two standard deviations are
/// what a LiFe cell that was taken off its charger early showed too much; LiPo and Li-ion cells showed 11 and 17 %.
const SURFACE_SOC: f32 = 0.80;
const SURFACE_WIDTH: f32 = 0.1;
const SURFACE_SIGMA: f32 = 0.15;

/// Change of a stored charge by self-discharge, or by charging that leaves the voltage alone.
const PAUSE_SIGMA: f32 = 0.03;

/// Standard deviation of a measured resistance, relative to it: the noise of the sensors, and its change with load and
/// charge. The model of the sag has the same.
const RESISTANCE_SIGMA: f32 = 0.1;

/// Standard deviation of what lies anywhere in a range, relative to the range.
const UNIFORM_SIGMA: f32 = 0.29;

/// Gathers what the first estimate is made from.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    elapsed_s: f32,
    first: First,
    averaged_s: f32,
    cell_v: Sum,
    current_a: Sum,
    before_v: Option<f32>,
    /// The voltage of a cell that a rest keeps to, in volts, and for how long, in seconds.
    rest_v: f32,
    rested_s: f32,
    /// For how long it was one that only a full cell keeps, in seconds.
    full_s: f32,
    /// The highest estimate of a rest, less what was drawn since.
    at_rest: Option<Filter>,
    provisional: Option<KnownCharge>,
}

/// The first quarter of a second.
#[derive(Clone, Copy, Debug)]
struct First {
    /// Highest voltage of the pack, in volts.
    voltage_v: Option<f32>,
    /// Lowest current, in amperes.
    current_a: Option<f32>,
}

/// A first estimate.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    pub filter: Filter,
    /// Whether the cells have rested; else the load before is unknown.
    pub has_rested: bool,
}

impl Start {
    /// Nothing yet.
    pub const NEW: Self = Self {
        elapsed_s: 0.0,
        first: First::NEW,
        averaged_s: 0.0,
        cell_v: Sum::NEW,
        current_a: Sum::NEW,
        before_v: None,
        rest_v: 0.0,
        rested_s: 0.0,
        full_s: 0.0,
        at_rest: None,
        provisional: None,
    };

    /// Takes a reading of the pack.
    pub fn add(&mut self, dt_s: f32, voltage_v: Option<f32>, current_a: Option<f32>) {
        self.elapsed_s += dt_s;
        if self.elapsed_s <= FIRST_S || self.first.voltage_v.is_none() {
            self.first.add(voltage_v, current_a);
        }
    }

    /// An estimate that may still be too low: the cells have not rested for long, or are under load.
    pub fn provisional(&self) -> Option<KnownCharge> {
        self.provisional
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
            if let Some(filter) = self.rest(load, cell_v, model, capacity) {
                let has_rested = true;
                return Some(Found { filter, has_rested });
            }
        } else {
            self.end_rest(load, capacity);
        }
        let filter = self.found_under_load(model, capacity)?;
        Some(Found {
            filter,
            has_rested: false,
        })
    }

    /// Returns the estimate of a pack that has rested.
    fn rest(&mut self, load: &Load, cell_v: f32, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        if (cell_v - self.rest_v).abs() > RESTED_CHANGE_V {
            self.rest_v = cell_v;
            self.rested_s = 0.0;
        }
        self.rested_s += load.duration_s;
        if is_above_full(cell_v, model) {
            self.full_s += load.duration_s;
        }
        if let Some(full) = kept_full(self.full_s, cell_v, model, capacity) {
            return Some(full);
        }
        let by_voltage = Filter::from_voltage(load, cell_v, model, capacity);
        let known = full(&by_voltage, Relaxation::Unknown, model, capacity)
            .filter(|_| !was_used(cell_v, model))
            .or_else(|| remembered(cell_v, model, capacity));
        let found = known.unwrap_or(provisional(by_voltage));
        if self.rested_s >= known.map_or(RESTED_S, |_| CONFIRMED_S) {
            return Some(found);
        }
        let is_higher = |before: &Filter| found.soc() > before.soc();
        if self.at_rest.as_ref().is_none_or(is_higher) {
            self.at_rest = Some(found);
        }
        None
    }

    fn end_rest(&mut self, load: &Load, capacity: &Capacity) {
        self.rested_s = 0.0;
        self.full_s = 0.0;
        if let Some(at_rest) = &mut self.at_rest {
            at_rest.draw(load.drawn_ah() / capacity.ah);
        }
    }

    fn found_under_load(&mut self, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        if self.first.is_full(model, capacity) {
            let full = Filter::from_soc(1.0, CERTAIN_SIGMA, model, capacity);
            return Some(self.drawn_since(full, capacity));
        }
        let highest = self.highest(model, capacity)?;
        if self.averaged_s >= AVERAGING_S {
            return Some(highest);
        }
        let is_averaged = self.averaged_s >= FIRST_AVERAGE_S;
        let provisional = self.at_rest.or(is_averaged.then_some(highest));
        self.provisional = provisional.as_ref().map(Filter::charge);
        None
    }

    /// The estimate now, after one of the first moment.
    fn drawn_since(&self, mut first: Filter, capacity: &Capacity) -> Filter {
        first.draw(self.current_a.integral() * HOURS_PER_SECOND / capacity.ah);
        first
    }

    /// A load only lowers the voltage: of several estimates the highest counts.
    fn highest(&self, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        let current_a = self.current_a.mean(self.averaged_s)?;
        let load = Load {
            duration_s: self.averaged_s,
            current_a,
            slow_a: current_a,
        };
        let drawn = load.drawn_ah() / capacity.ah;
        let cell_v = self.cell_v.mean(self.averaged_s)?;
        let mut averaged = Filter::from_voltage(&load, cell_v, model, capacity);
        // If the load has only begun, its slow sag has not developed; a typical resistance may be too large.
        let immediate_v = load.sag_v(model.own_ohm().unwrap_or(0.0), 0.0);
        averaged.inflate(UNIFORM_SIGMA * (averaged.soc() - model.soc(cell_v + immediate_v)));
        averaged.draw(0.5 * drawn);
        let first = self.first.estimate(model, capacity);
        let first = first.map(|first| self.drawn_since(first, capacity));
        let others = first.into_iter().chain(self.at_rest);
        let mut highest = others.fold(averaged, |highest, other| {
            if other.soc() > highest.soc() {
                other
            } else {
                highest
            }
        });
        // No pack is above full: nearer to it than half a deviation, an estimate is too high.
        highest.draw((highest.soc() + 0.5 * highest.sigma() - 1.0).max(0.0));
        Some(highest)
    }
}

impl First {
    const NEW: Self = Self {
        voltage_v: None,
        current_a: None,
    };

    fn add(&mut self, voltage_v: Option<f32>, current_a: Option<f32>) {
        self.voltage_v = self.voltage_v.into_iter().chain(voltage_v).reduce(f32::max);
        self.current_a = self.current_a.into_iter().chain(current_a).reduce(f32::min);
    }

    /// A lower limit of the resting voltage of a cell, in volts: a load only lowers its voltage. Charging raises it.
    fn least_resting_v(&self, model: &CellModel, capacity: &Capacity) -> Option<f32> {
        let (voltage_v, count) = self.voltage_v.zip(model.cell_count)?;
        let current_a = self.current_a.unwrap_or(0.0);
        let is_charged = current_a < 0.0 && !is_resting(current_a, capacity);
        let sag_v = least_sag_v(current_a, model, capacity);
        (!is_charged).then_some(voltage_v / f32::from(count) + sag_v)
    }

    /// Whether only a full pack has such a voltage under such a load.
    fn is_full(&self, model: &CellModel, capacity: &Capacity) -> bool {
        // A learnt offset is that of a fifth of the charge, not of the last twentieth.
        let typical = CellModel {
            learnt: &LearntPack::UNKNOWN,
            ..*model
        };
        let resting_v = self
            .least_resting_v(model, capacity)
            .filter(|resting_v| !was_used(*resting_v, model));
        let by_voltage =
            resting_v.map(|resting_v| Filter::from_voltage(&Load::NONE, resting_v, &typical, capacity));
        by_voltage
            .and_then(|by_voltage| full(&by_voltage, Relaxation::Unknown, &typical, capacity))
            .is_some()
    }

    /// The estimate by this limit. After a restart under load the slow sag is in the voltage too: the deviation holds it.
    fn estimate(&self, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
        let resting_v = self.least_resting_v(model, capacity)?;
        let mut estimate = Filter::from_voltage(&Load::NONE, resting_v, model, capacity);
        let slow_v = model.slow_share() * model.resistance_ohm(capacity) * self.current_a.unwrap_or(0.0);
        estimate.inflate(slow_v / model.slope_v(estimate.soc()));
        Some(estimate)
    }
}

/// The least voltage that a load takes off a cell in its first moment, in volts: by a resistance two standard deviations
/// below that of this very pack. It is never more than what a typical cell's immediate resistance takes off at one
/// capacity an hour: of the resistance of a cold cell less than half has developed, and a half-empty cell does not read
/// full by that.
fn least_sag_v(current_a: f32, model: &CellModel, capacity: &Capacity) -> f32 {
    let Some(ohm) = model.own_ohm() else {
        return 0.0;
    };
    let rate_per_h = (current_a / capacity.ah).clamp(0.0, 1.0);
    let drop_v = (1.0 - 2.0 * RESISTANCE_SIGMA) * ohm * capacity.ah;
    rate_per_h * drop_v.min(model.cell.ohmic_drop_v)
}

/// Whether a pack that rests at this voltage of a cell was left below full, and not charged since.
fn was_used(cell_v: f32, model: &CellModel) -> bool {
    let last = model.learnt.charge;
    last.is_some_and(|last| {
        last.soc < 1.0 - BOUND_SIGMAS * CERTAIN_SIGMA && cell_v <= last.resting_v + SAME_VOLTAGE_V
    })
}

/// The estimate for a pack that rests at this voltage of a cell, weighing the kept charge against the voltage.
fn remembered(cell_v: f32, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
    let last = model.last_charge(cell_v)?;
    let sigma = root_of_squares(last.sigma, PAUSE_SIGMA);
    let mut filter = Filter::from_soc(last.soc, sigma, model, capacity);
    filter.rest(&Filter::from_voltage(&Load::NONE, cell_v, model, capacity));
    Some(filter)
}

/// Whether a small steady current is drawn with the load off: a rest with a sag that is known.
pub fn is_idle(load: &Load, polarisation: &Polarisation, model: &CellModel, capacity: &Capacity) -> bool {
    let is_steady = polarisation
        .recent_a()
        .is_some_and(|recent_a| (load.current_a - recent_a).abs() < STEADY_RATE_PER_H * capacity.ah);
    let is_small = (0.0..MAX_IDLE_RATE_PER_H * capacity.ah).contains(&load.current_a);
    is_small && is_steady && model.measured_ohm.is_some()
}

/// Whether a current is that of a pack at rest.
pub fn is_resting(current_a: f32, capacity: &Capacity) -> bool {
    current_a.abs() < RESTING_RATE_PER_H * capacity.ah
}

/// Whether a pack was charged in the last minutes.
pub fn was_charged(load: &Load, capacity: &Capacity) -> bool {
    load.slow_a < -CHARGED_RATE_PER_H * capacity.ah
}

/// The estimate at the end of charging: the current has fallen at the voltage of a full pack. On a curve with a plateau that is
/// the voltage of the charger: lower ones are reached long before.
pub fn charged(block: &Block, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
    if !was_charged(&block.load, capacity) || !is_resting(block.load.current_a, capacity) {
        return None;
    }
    let cell_v = block.cell_v?;
    if cell_v >= model.voltage_v(1.0) {
        return Some(Filter::from_soc(1.0, CERTAIN_SIGMA, model, capacity));
    }
    let by_voltage = Filter::from_voltage(&block.load, cell_v, model, capacity);
    full(&by_voltage, Relaxation::Unknown, model, capacity)
}

/// Whether a voltage says little of the charge.
pub fn is_flat(by_voltage: &Filter) -> bool {
    by_voltage.sigma() > STEEP_SIGMA
}

/// Whether a cell has had the time to relax.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relaxation {
    Unknown,
    Relaxed,
}

/// Whether a cell that keeps this voltage at rest is full.
fn is_above_full(cell_v: f32, model: &CellModel) -> bool {
    model.cell.full_v.is_some_and(|full_v| cell_v >= full_v)
}

/// The estimate for a cell that has kept this voltage for so long at rest, in seconds, if only a full one does.
pub fn kept_full(rested_s: f32, cell_v: f32, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
    let is_kept = rested_s >= KEPT_S && is_above_full(cell_v, model);
    is_kept.then(|| Filter::from_soc(1.0, CERTAIN_SIGMA, model, capacity))
}

/// The estimate for a voltage that only a full cell has. On a curve with a plateau it is that of a cell that has relaxed.
pub fn full(
    by_voltage: &Filter,
    relaxation: Relaxation,
    model: &CellModel,
    capacity: &Capacity,
) -> Option<Filter> {
    let is_full = by_voltage.soc() >= FULL_SOC
        && !is_flat(by_voltage)
        && (relaxation == Relaxation::Relaxed || !has_plateau(model));
    is_full.then(|| Filter::from_soc(1.0, CERTAIN_SIGMA, model, capacity))
}

/// Whether such a cell may have been charged a moment ago.
pub fn may_have_surface_charge(estimate: &Filter) -> bool {
    estimate.soc() >= SURFACE_SOC
}

/// The estimate by the voltage of a cell that may not have relaxed.
pub fn provisional(mut by_voltage: Filter) -> Filter {
    let beyond = (by_voltage.soc() - SURFACE_SOC) / SURFACE_WIDTH;
    by_voltage.inflate(SURFACE_SIGMA * beyond.clamp(0.0, 1.0));
    by_voltage
}

#[cfg(test)]
mod tests {
    use super::super::cell_model::EndVoltage;
    use super::*;
    use crate::Chemistry;
    use crate::PackSettings;
    use crate::learnt::LearntResistance;

    const CAPACITY: Capacity = Capacity { ah: 2.9, sigma: 0.04 };

    fn li_ion(measured_ohm: Option<f32>, learnt: &LearntPack) -> CellModel<'_> {
        CellModel {
            chemistry: Chemistry::LiIon,
            cell: Chemistry::LiIon.cell(),
            cell_count: Some(1),
            rated_ah: Some(CAPACITY.ah),
            measured_ohm,
            end: EndVoltage::new(&PackSettings::default(), None),
            soc_at_most: 1.0,
            measured: None,
            learnt,
        }
    }

    /// The start after a second under a load.
    fn found(cell_v: f32, current_a: f32, model: &CellModel) -> Option<Found> {
        let mut start = Start::NEW;
        start.add(0.1, Some(cell_v), Some(current_a));
        let second = Load {
            duration_s: 1.0,
            current_a,
            slow_a: 0.0,
        };
        start.update(&second, cell_v - 0.2, model, &CAPACITY)
    }

    fn is_full(found: Option<Found>) -> bool {
        matches!(found, Some(Found { filter, has_rested: false }) if filter.soc() > 0.99 && filter.sigma() < 0.02)
    }

    fn kept(serial_number: Option<i32>) -> LearntPack {
        LearntPack {
            resistance: Some(LearntResistance {
                now_ohm: 0.03,
                first_ohm: 0.03,
            }),
            ..LearntPack::of(serial_number)
        }
    }

    #[test]
    fn a_full_pack_under_load_is_certain_once_its_resistance_is_known() {
        let unknown = LearntPack::UNKNOWN;
        for (cell_v, current_a, measured_ohm, learnt, expected) in [
            (4.06, 2.8, None, unknown, false),
            (4.06, 2.8, Some(0.12), unknown, true),
            // Two standard deviations less would not be full.
            (4.06, 2.8, Some(0.02), unknown, false),
            // A kept resistance counts for the pack with its serial number.
            (4.06, 2.8, None, kept(Some(7)), true),
            (4.06, 2.8, None, kept(None), false),
            // One that is charged is not full by its voltage.
            (4.19, 1.0, None, unknown, true),
            (4.19, -1.0, None, unknown, false),
        ] {
            let found = found(cell_v, current_a, &li_ion(measured_ohm, &learnt));
            assert_eq!(
                is_full(found),
                expected,
                "{cell_v} V {current_a} A {measured_ohm:?}"
            );
        }
    }
}
