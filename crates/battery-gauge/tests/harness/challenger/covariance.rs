//! A symmetric matrix over the states, of which each pair is kept once.

use super::states::{STATES, Vector};

const PAIRS: usize = STATES * (STATES + 1) / 2;

#[derive(Clone, Debug)]
pub struct Covariance([f64; PAIRS]);

fn pair(row: usize, column: usize) -> usize {
    let (low, high) = (row.min(column), row.max(column));
    high * (high + 1) / 2 + low
}

impl Covariance {
    pub const ZERO: Self = Self([0.0; PAIRS]);

    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.0[pair(row, column)]
    }

    pub fn add(&mut self, row: usize, column: usize, more: f64) {
        self.0[pair(row, column)] += more;
    }

    pub fn add_weighted(&mut self, weight: f64, other: &Self) {
        for (here, there) in self.0.iter_mut().zip(other.0) {
            *here += weight * there;
        }
    }

    /// Adds the product of a vector with itself.
    pub fn add_product(&mut self, weight: f64, vector: &Vector) {
        self.add_product_where(weight, vector, |_, _| true);
    }

    /// The same for some pairs of states.
    pub fn add_product_where(&mut self, weight: f64, vector: &Vector, which: impl Fn(usize, usize) -> bool) {
        for row in 0..STATES {
            for column in 0..=row {
                if which(row, column) {
                    self.0[pair(row, column)] += weight * vector[row] * vector[column];
                }
            }
        }
    }

    pub fn row(&self, row: usize) -> Vector {
        std::array::from_fn(|column| self.get(row, column))
    }

    /// Covariance of each state with a combination of them.
    pub fn times(&self, combination: &Vector) -> Vector {
        let mut product = [0.0; STATES];
        for (row, factor) in combination.iter().enumerate() {
            if *factor != 0.0 {
                for (column, sum) in product.iter_mut().enumerate() {
                    *sum += factor * self.get(row, column);
                }
            }
        }
        product
    }

    /// A state is multiplied by a factor.
    pub fn scale(&mut self, state: usize, factor: f64) {
        for other in 0..STATES {
            self.0[pair(state, other)] *= factor;
        }
        self.0[pair(state, state)] *= factor;
    }

    /// A multiple of another state is added to a state.
    pub fn add_state(&mut self, to: usize, factor: f64, from: usize) {
        let source = self.row(from);
        for (other, covariance) in source.iter().enumerate() {
            self.add(to, other, factor * covariance);
        }
        // Its covariance with itself has got this once; `from` has got it on the way.
        let both = self.get(to, from);
        self.add(to, to, factor * both);
    }

    /// No state is more certain than this.
    pub fn keep_positive(&mut self, least_variance: f64) {
        for state in 0..STATES {
            let variance = &mut self.0[pair(state, state)];
            *variance = variance.max(least_variance);
        }
    }
}
