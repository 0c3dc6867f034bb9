//! Charges that are known: kept over a reset or a power cycle, or set by the owner.

use super::cell_model::{Capacity, CellModel};
use super::deviation::root_of_squares;
use super::filter::Filter;
use crate::battery::learnt::LastCharge;

/// A pack that still rests within this of its last resting voltage was neither charged nor used, in volts.
const SAME_VOLTAGE_V: f32 = 0.015;

/// What self-discharge and a charge that leaves the voltage alone may have changed.
const PAUSE_SIGMA: f32 = 0.03;

/// Standard deviation of a state of charge that the owner sets.
const SET_SIGMA: f32 = 0.01;

/// A state of charge that is kept over a reset, set by the owner, or provisional.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::battery) struct KnownCharge {
    /// From 0 to 1.
    pub share: f32,
    /// Standard deviation.
    pub sigma: f32,
}

impl KnownCharge {
    /// As the owner says, from 0 to 1.
    pub const fn set(share: f32) -> Self {
        Self {
            share,
            sigma: SET_SIGMA,
        }
    }

    pub fn to_words(self) -> [u32; 2] {
        [self.share, self.sigma].map(f32::to_bits)
    }

    /// `None` if no state of charge has these words.
    pub fn from_words(words: [u32; 2]) -> Option<Self> {
        let [share, sigma] = words.map(f32::from_bits);
        let is_possible = (0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&sigma);
        is_possible.then_some(Self { share, sigma })
    }
}

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
