//! The pack before a loss of contact, and whether the one that rests after it is the same.

use super::cell_model::{Capacity, CellModel};
use super::filter::{OFFSET_SPAN, SAG_NOISE};
use super::load::Load;
use crate::battery::chemistry::SAME_VOLTAGE_V;

/// A state of charge with the voltage and load under which a cell had it.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    pub soc: f32,
    pub cell_v: f32,
    pub load: Load,
}

impl Reference {
    /// Whether a cell that was like this is now at the voltage that count and relaxation predict.
    pub fn fits(&self, now: &Self, model: &CellModel, capacity: &Capacity) -> bool {
        let ohm = model.resistance_ohm(capacity);
        let recovered_a = self.load.current_a - now.load.current_a;
        let relaxed_a = self.load.slow_a - now.load.slow_a;
        let relaxation_v = ohm * (recovered_a + model.slow_share() * relaxed_a);
        let counted_v = model.voltage_v(now.soc) - model.voltage_v(self.soc);
        let expected_v = self.cell_v + relaxation_v + counted_v;
        // Each is known as well as the filter knows it.
        let relaxation_sigma_v =
            ohm * (SAG_NOISE * recovered_a.abs() + model.slow_share_sigma() * relaxed_a.abs());
        let counted = (now.soc - self.soc).abs() / OFFSET_SPAN;
        let counted_sigma_v = model.cell.curve_sigma_v * counted.min(1.0);
        let tolerance_v = SAME_VOLTAGE_V + relaxation_sigma_v + counted_sigma_v;
        (now.cell_v - expected_v).abs() <= tolerance_v
    }
}
