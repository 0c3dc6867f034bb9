//! Correction by the mean voltage of a block.

use super::cell::{Cell, Load};
use super::states::{CHARGE, FAST, FINE, GROWTH, Gaussian, RESISTANCE, SLOW, Vector};

/// How far a steeper chord of the curve is searched: in deviations, and at least, in charge; chosen on recordings.
const REACH_SIGMAS: f64 = 3.0;
const LEAST_REACH: f64 = 0.1;

/// Iterations end when charge and resistance change by less.
const CONVERGED: f64 = 0.002;
const MOST_ITERATIONS: usize = 4;

/// Variances stay above this.
const LEAST_VARIANCE: f64 = 1e-9;

/// Bounds of a charge.
const CHARGES: (f64, f64) = (-0.1, 1.02);
/// Most that an iteration changes the logarithm of the resistance by.
const MOST_RESISTANCE: f64 = 0.7;
/// Least share of the slow sags.
const LEAST_SHARE: f64 = 0.02;

/// States that are corrected; of the others the doubt counts, and the values stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learning {
    All,
    /// All but the slow shares and the growth of the sag.
    NoShape,
}

impl Learning {
    pub fn includes(self, state: usize) -> bool {
        match self {
            Self::All => true,
            Self::NoShape => !(FAST..FINE).contains(&state),
        }
    }
}

/// How well a voltage fitted.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    pub log_likelihood: f64,
    /// Difference from what was expected, in deviations of that.
    pub surprise: f64,
}

/// Corrects by a voltage with this variance of its noise.
pub fn correct(
    gaussian: &mut Gaussian,
    voltage_v: f64,
    load: &Load,
    noise: f64,
    learning: Learning,
    cell: &Cell,
) -> Fit {
    let mean = gaussian.mean;
    let mut at = mean;
    let mut variance = gaussian.covariance.get(CHARGE, CHARGE);
    let mut fit = None;
    let mut last = ([0.0; _], 1.0);
    for _ in 0..MOST_ITERATIONS {
        let mut linear = cell.linearised(&at, variance.sqrt(), load);
        if fit.is_none() {
            let reach = (REACH_SIGMAS * variance.sqrt()).max(LEAST_REACH);
            let chord_v = cell
                .chord_v(&at, voltage_v, reach, load)
                .filter(|chord_v| *chord_v > 0.0);
            let slope_v = &mut linear.gradient[CHARGE];
            *slope_v = chord_v.map_or(*slope_v, |chord_v| slope_v.min(chord_v));
        }
        let with_voltage = gaussian.covariance.times(&linear.gradient);
        let total = noise + linear.rest + dot(&linear.gradient, &with_voltage);
        let moved: Vector = std::array::from_fn(|state| mean[state] - at[state]);
        let innovation_v = voltage_v - linear.mean_v - dot(&linear.gradient, &moved);
        fit.get_or_insert(Fit {
            log_likelihood: -0.5 * (innovation_v * innovation_v / total + total.ln()),
            surprise: innovation_v / total.sqrt(),
        });
        let new = corrected(
            &mean,
            &at,
            &with_voltage.map(|part| part * innovation_v / total),
            learning,
        );
        let change = (new[CHARGE] - at[CHARGE]).abs() + (new[RESISTANCE] - at[RESISTANCE]).abs();
        at = new;
        variance = (gaussian.covariance.get(CHARGE, CHARGE)
            - with_voltage[CHARGE] * with_voltage[CHARGE] / total)
            .max(1e-7);
        last = (with_voltage, total);
        if change < CONVERGED {
            break;
        }
    }
    gaussian.mean = at;
    let (with_voltage, total) = last;
    let is_learnt = |row: usize, column: usize| learning.includes(row) || learning.includes(column);
    gaussian
        .covariance
        .add_product_where(-1.0 / total, &with_voltage, is_learnt);
    gaussian.covariance.keep_positive(LEAST_VARIANCE);
    fit.expect("at least one iteration")
}

/// The mean moved where it is learnt, within bounds.
fn corrected(mean: &Vector, at: &Vector, change: &Vector, learning: Learning) -> Vector {
    let mut new: Vector = std::array::from_fn(|state| {
        mean[state]
            + if learning.includes(state) {
                change[state]
            } else {
                0.0
            }
    });
    let (least, most) = CHARGES;
    new[CHARGE] = new[CHARGE].clamp(least, most);
    if learning.includes(RESISTANCE) {
        let here = at[RESISTANCE];
        new[RESISTANCE] = new[RESISTANCE].clamp(here - MOST_RESISTANCE, here + MOST_RESISTANCE);
    }
    if learning.includes(FAST) {
        new[FAST] = new[FAST].max(LEAST_SHARE);
        new[SLOW] = new[SLOW].max(LEAST_SHARE);
        new[GROWTH] = new[GROWTH].max(0.0);
    }
    new
}

fn dot(here: &Vector, there: &Vector) -> f64 {
    here.iter().zip(there).map(|(here, there)| here * there).sum()
}
