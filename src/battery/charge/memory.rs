//! The charge of a pack that was kept over a power cycle.

use super::cell_model::{Capacity, CellModel};
use super::deviation::root_of_squares;
use super::filter::Filter;
use crate::battery::learnt::LastCharge;

/// A pack that still rests within this of its last resting voltage was neither charged nor used, in volts.
const SAME_VOLTAGE_V: f32 = 0.015;

/// What self-discharge and a charge that leaves the voltage alone may have changed.
const PAUSE_SIGMA: f32 = 0.03;

/// The kept charge of a pack that rests at this voltage of a cell, if it is still the same.
pub(super) fn last_charge(cell_v: f32, model: &CellModel) -> Option<LastCharge> {
    let last = model.learnt.charge?;
    ((cell_v - last.resting_v).abs() <= SAME_VOLTAGE_V).then_some(last)
}

/// The estimate for a pack that rests at this voltage of a cell, weighing the kept charge against the voltage.
pub(super) fn remembered(cell_v: f32, model: &CellModel, capacity: &Capacity) -> Option<Filter> {
    let last = last_charge(cell_v, model)?;
    let sigma = root_of_squares(last.sigma, PAUSE_SIGMA);
    let mut filter = Filter::from_share(last.share, sigma, model, capacity);
    filter.rest(cell_v, model);
    Some(filter)
}
