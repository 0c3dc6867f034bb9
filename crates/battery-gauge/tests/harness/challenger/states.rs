//! States of the filter, and one Gaussian over all of them.

use super::covariance::Covariance;

/// State of charge, from 0 to 1.
pub const CHARGE: usize = 0;
/// Logarithm of the capacity over the label's.
pub const CAPACITY: usize = 1;
/// Logarithm of the fast resistance over that of a typical cell.
pub const RESISTANCE: usize = 2;
/// Share of the sag that follows a load within 10 and 100 s, relative to the fast one.
pub const FAST: usize = 3;
/// Share that follows within 1000 s.
pub const SLOW: usize = 4;
/// Growth of the sag towards empty, relative to it.
pub const GROWTH: usize = 5;
/// Error of the curve that is too fine for its knots, in volts.
pub const FINE: usize = 6;
/// Relative error of the sag.
pub const SAG: usize = 7;
/// The first of the deviations from the chemistry's curve at [`KNOTS`], in volts.
pub const KNOT: usize = 8;

/// States of charge at which the curve of this cell is estimated; linear between.
pub const KNOTS: [f64; 10] = [0.0, 0.05, 0.12, 0.22, 0.35, 0.5, 0.65, 0.8, 0.92, 1.0];

pub const STATES: usize = KNOT + KNOTS.len();

/// A number for each state.
pub type Vector = [f64; STATES];

#[derive(Clone, Debug)]
pub struct Gaussian {
    pub mean: Vector,
    pub covariance: Covariance,
}

impl Gaussian {
    pub fn sigma(&self, state: usize) -> f64 {
        self.covariance.get(state, state).max(0.0).sqrt()
    }

    /// Makes a state independent of the others.
    pub fn set(&mut self, state: usize, mean: f64, sigma: f64) {
        self.mean[state] = mean;
        self.covariance.scale(state, 0.0);
        self.covariance.add(state, state, sigma * sigma);
    }

    /// A state returns to a mean; `left` is the part of its deviation that stays.
    pub fn revert(&mut self, state: usize, left: f64, mean: f64, sigma: f64) {
        self.mean[state] = mean + (self.mean[state] - mean) * left;
        self.covariance.scale(state, left);
        self.covariance
            .add(state, state, (1.0 - left * left) * sigma * sigma);
    }

    /// One Gaussian with the mean and the covariance of several, by their weights, whose sum is 1.
    pub fn merged<'a>(parts: impl Iterator<Item = (f64, &'a Self)> + Clone) -> Self {
        let mut merged = Self {
            mean: [0.0; STATES],
            covariance: Covariance::ZERO,
        };
        for (weight, part) in parts.clone() {
            for (mean, here) in merged.mean.iter_mut().zip(part.mean) {
                *mean += weight * here;
            }
        }
        for (weight, part) in parts {
            let off: Vector = std::array::from_fn(|state| part.mean[state] - merged.mean[state]);
            merged.covariance.add_weighted(weight, &part.covariance);
            merged.covariance.add_product(weight, &off);
        }
        merged
    }
}
