//! The pack before a loss of contact or a restart, and whether the one that rests after it is the same.

use super::cell_model::CellModel;
use super::filter::{OFFSET_SPAN, SAG_NOISE};
use super::load::Load;
use crate::chemistry::SAME_VOLTAGE_V;

/// Limit of what a record may hold, in volts and amperes.
const MAX_VALUE: f32 = 1e4;

/// Over a restart half of what is left of earlier loads has gone, and up to this share more or less: all or nothing, and
/// as much as the time that each part of it lasts is unknown.
const UNSEEN_SHARE: f32 = 0.5;
const UNSEEN_SIGMA: f32 = 0.7;

/// Whether a pack at rest is the one that was counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PackIdentity {
    Same,
    /// That pack with another charge, or with its voltage under another scale.
    OtherCharge,
    /// Another pack, or that one after charging.
    Another,
}

/// A state of charge with the voltage at which a cell had it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    pub soc: f32,
    /// Without the immediate part of the load's sag, in volts.
    cell_v: f32,
    /// Its standard deviation, in volts.
    sigma_v: f32,
    /// The rest of earlier loads, in amperes.
    pub slow_a: f32,
    /// Over a restart the cell may have relaxed for any time.
    pub is_retained: bool,
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

    /// A charge was drawn since, in capacities.
    pub fn draw(&mut self, drawn: f32, model: &CellModel) {
        let soc = (self.soc - drawn).clamp(0.0, 1.0);
        self.cell_v += model.voltage_v(soc) - model.voltage_v(self.soc);
        self.sigma_v += model.cell.curve_sigma_v * drawn.abs() / OFFSET_SPAN;
        self.soc = soc;
    }

    /// Whether count and relaxation predict the voltage of the present cell; and by how much it shows that cell fuller or
    /// emptier than is estimated, relative to the capacity.
    #[inline(never)]
    pub fn compare(&self, now: &Self, model: &CellModel) -> (PackIdentity, f32) {
        let ohm = resistance_ohm(model);
        let slow_ohm = model.slow_share() * ohm;
        let mut slow_a = now.slow_a;
        let mut tolerance_v = SAME_VOLTAGE_V + self.sigma_v + now.sigma_v;
        if self.is_retained {
            slow_a *= UNSEEN_SHARE;
            tolerance_v += UNSEEN_SIGMA * slow_ohm * now.slow_a.abs();
        }
        // Each is known as well as the filter knows it.
        let relaxed_a = self.slow_a - slow_a;
        tolerance_v += ohm * model.slow_share_sigma() * relaxed_a.abs();
        let unexplained_v = now.cell_v - self.cell_v - slow_ohm * relaxed_a;
        let shown = model.soc(model.voltage_v(self.soc) + unexplained_v);
        let identity = if unexplained_v.abs() <= tolerance_v {
            PackIdentity::Same
        } else if self.is_retained {
            PackIdentity::Another
        } else {
            PackIdentity::OtherCharge
        };
        (identity, (shown - now.soc).abs())
    }

    /// The highest voltage at which such a cell can rest, in volts.
    pub fn highest_v(&self, model: &CellModel) -> f32 {
        let relaxed_v = resistance_ohm(model) * self.slow_a.max(0.0);
        let relaxation = model.slow_share() + model.slow_share_sigma();
        self.cell_v + self.sigma_v + SAME_VOLTAGE_V + relaxation * relaxed_v
    }

    /// But for the state of charge.
    pub fn to_words(self) -> [u32; 3] {
        [self.cell_v, self.sigma_v, self.slow_a].map(f32::to_bits)
    }

    /// At this state of charge; `None` if no cell is like that.
    pub fn from_words(soc: f32, words: [u32; 3]) -> Option<Self> {
        let values = words.map(f32::from_bits);
        let [cell_v, sigma_v, slow_a] = values;
        let is_possible = cell_v > 0.0 && values.iter().all(|value| value.abs() <= MAX_VALUE);
        is_possible.then_some(Self {
            soc,
            cell_v,
            sigma_v,
            slow_a,
            is_retained: true,
        })
    }
}

/// The resistance of a cell, in ohms; 0 as long as nothing is known of it.
fn resistance_ohm(model: &CellModel) -> f32 {
    let capacity = model.capacity();
    capacity.map_or(0.0, |capacity| model.resistance_ohm(&capacity))
}
