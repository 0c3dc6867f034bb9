//! The pack before a loss of contact or a restart, and whether the one that rests after it is the same.

use super::Comparison;
use super::cell_model::CellModel;
use super::filter::{OFFSET_SPAN, SAG_NOISE};
use super::load::Load;
use crate::battery::chemistry::SAME_VOLTAGE_V;
use crate::battery::swap::MAX_RECOVERY;

/// Limits of what a record may hold: a voltage of a cell, in volts, and a current, in amperes.
const MAX_CELL_V: f32 = 10.0;
const MAX_CURRENT_A: f32 = 1e4;

/// A restart keeps the sum of what is left of earlier loads, not for how long each part lasts: standard deviation of their
/// sum later, relative to it.
const SUM_SIGMA: f32 = 0.2;

/// A state of charge with the voltage at which a cell had it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    pub soc: f32,
    /// Without the immediate part of the load's sag, in volts.
    cell_v: f32,
    /// How uncertain that is, in volts.
    sigma_v: f32,
    /// What is left of earlier loads, in amperes.
    slow_a: f32,
    /// Over a restart the cell may have relaxed for any time.
    is_retained: bool,
}

impl Reference {
    /// A cell with this state of charge has this voltage under this load.
    pub fn new(soc: f32, cell_v: f32, load: &Load, model: &CellModel) -> Self {
        let sag_v = resistance_ohm(model) * load.current_a;
        Self {
            soc,
            cell_v: cell_v + sag_v,
            sigma_v: SAG_NOISE * sag_v.abs(),
            slow_a: load.slow_a,
            is_retained: false,
        }
    }

    /// The same after a restart.
    pub fn retained(self) -> Self {
        Self {
            is_retained: true,
            ..self
        }
    }

    pub fn is_retained(&self) -> bool {
        self.is_retained
    }

    /// What is left of earlier loads, in amperes.
    pub fn slow_a(&self) -> f32 {
        self.slow_a
    }

    /// A charge was drawn since, in capacities.
    pub fn draw(&mut self, drawn: f32, model: &CellModel) {
        let soc = (self.soc - drawn).clamp(0.0, 1.0);
        self.cell_v += model.voltage_v(soc) - model.voltage_v(self.soc);
        self.sigma_v += model.cell.curve_sigma_v * drawn.abs() / OFFSET_SPAN;
        self.soc = soc;
    }

    /// By how much the voltage of a cell that was like this exceeds what count and relaxation predict, and how well that is
    /// known, in volts.
    fn unexplained_v(&self, now: &Self, model: &CellModel) -> (f32, f32) {
        let ohm = resistance_ohm(model);
        let relaxed_v = ohm * (self.slow_a - now.slow_a);
        let sum_sigma_v = if self.is_retained {
            SUM_SIGMA * model.slow_share() * ohm * now.slow_a.abs()
        } else {
            0.0
        };
        // Each is known as well as the filter knows it.
        let relaxation_sigma_v = model.slow_share_sigma() * relaxed_v.abs() + sum_sigma_v;
        let tolerance_v = SAME_VOLTAGE_V + self.sigma_v + now.sigma_v + relaxation_sigma_v;
        let unexplained_v = now.cell_v - self.cell_v - model.slow_share() * relaxed_v;
        (unexplained_v, tolerance_v)
    }

    /// Whether a cell that was like this may be the one that rests now.
    pub fn compare(&self, now: &Self, model: &CellModel) -> Comparison {
        let either = [*now, self.relaxed(now)].map(|now| self.unexplained_v(&now, model));
        let is_above = |(unexplained_v, tolerance_v): (f32, f32)| unexplained_v > tolerance_v;
        let is_below = |(unexplained_v, tolerance_v): (f32, f32)| unexplained_v < -tolerance_v;
        if !either.into_iter().all(is_above) && !either.into_iter().all(is_below) {
            Comparison::Same
        } else {
            self.other(now)
        }
    }

    /// Whether a cell that was like this may be the one that is now under a load.
    pub fn compare_under_load(&self, now: &Self, model: &CellModel) -> Comparison {
        let (unexplained_v, tolerance_v) = self.unexplained_v(now, model);
        if unexplained_v > tolerance_v {
            self.other(now)
        } else {
            Comparison::Same
        }
    }

    /// The present cell, if nothing is left of earlier loads over a restart.
    fn relaxed(&self, now: &Self) -> Self {
        Self {
            slow_a: if self.is_retained { 0.0 } else { now.slow_a },
            ..*now
        }
    }

    fn other(&self, now: &Self) -> Comparison {
        if !self.is_retained {
            Comparison::OtherCharge
        } else if (now.cell_v - self.cell_v).abs() > MAX_RECOVERY * self.cell_v {
            Comparison::Swapped
        } else {
            Comparison::Another
        }
    }

    /// By how much a cell with the present voltage may be fuller or emptier than is estimated, relative to the capacity, as a
    /// standard deviation.
    pub fn contradiction(&self, now: &Self, model: &CellModel) -> f32 {
        let beyond = |now: &Self| {
            let (unexplained_v, _) = self.unexplained_v(now, model);
            (model.soc(model.voltage_v(self.soc) + unexplained_v) - now.soc).abs()
        };
        beyond(now).max(0.5 * beyond(&self.relaxed(now)))
    }

    /// But for the state of charge.
    pub fn to_words(self) -> [u32; 3] {
        [self.cell_v, self.sigma_v, self.slow_a].map(f32::to_bits)
    }

    /// At this state of charge; `None` if no cell is like that.
    pub fn from_words(soc: f32, words: [u32; 3]) -> Option<Self> {
        let [cell_v, sigma_v, slow_a] = words.map(f32::from_bits);
        let is_possible = (f32::MIN_POSITIVE..=MAX_CELL_V).contains(&cell_v)
            && (0.0..=MAX_CELL_V).contains(&sigma_v)
            && slow_a.abs() <= MAX_CURRENT_A;
        is_possible.then_some(Self {
            soc,
            cell_v,
            sigma_v,
            slow_a,
            is_retained: false,
        })
    }
}

/// The resistance of a cell, in ohms: measured, else typical, else learnt.
fn resistance_ohm(model: &CellModel) -> f32 {
    let by_capacity = |capacity| model.resistance_ohm(&capacity);
    model
        .capacity()
        .map(by_capacity)
        .or(model.known_ohm())
        .unwrap_or(0.0)
}
