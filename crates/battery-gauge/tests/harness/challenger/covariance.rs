//! A symmetric matrix over the states, of which each pair is kept once.

use super::states::{STATES, Vector};

const PAIRS: usize = STATES * (STATES + 1) / 2;

/// Below this eigenvalue of the correlations, all states get more doubt of their own: assumed.
const LEAST_EIGENVALUE: f64 = 0.002;

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

    /// Adds the weighted product of `vector` with itself for some pairs of states.
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

    /// No state becomes a combination of others.
    pub fn keep_apart(&mut self) {
        if !self.is_above(LEAST_EIGENVALUE) {
            for state in 0..STATES {
                self.0[pair(state, state)] *= 1.0 + 2.0 * LEAST_EIGENVALUE;
            }
        }
    }

    /// Whether the smallest eigenvalue of the correlations is above a limit: the rest has a Cholesky factor.
    pub fn is_above(&self, least_eigenvalue: f64) -> bool {
        let sigma: Vector = std::array::from_fn(|state| self.get(state, state).sqrt());
        let mut factor = [[0.0; STATES]; STATES];
        for row in 0..STATES {
            for column in 0..=row {
                let done: f64 = (0..column)
                    .map(|inner| factor[row][inner] * factor[column][inner])
                    .sum();
                let left = self.get(row, column) / (sigma[row] * sigma[column]) - done;
                if row > column {
                    factor[row][column] = left / factor[column][column];
                } else if left > least_eigenvalue {
                    factor[row][row] = (left - least_eigenvalue).sqrt();
                } else {
                    return false;
                }
            }
        }
        true
    }
}

/// Two states that are alike but for a little have an eigenvalue of that little.
#[test]
fn the_smallest_eigenvalue_of_the_correlations_is_bounded() {
    let mut covariance = Covariance::ZERO;
    covariance.add_product(4.0, &std::array::from_fn(|state| f64::from(state < 2)));
    for state in 0..STATES {
        covariance.add(state, state, if state < 2 { 0.02 } else { 1e-6 });
    }
    let smallest = 0.02 / 4.02;
    assert!(covariance.is_above(0.99 * smallest));
    assert!(!covariance.is_above(1.01 * smallest));
}
