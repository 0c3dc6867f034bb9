//! Changes of the states with time, charge drawn and steps of the load.

use super::block::Block;
use super::cell::Cell;
use super::states::{CAPACITY, CHARGE, FAST, FINE, Gaussian, RESISTANCE, SAG};

/// The curve's fine error, all chosen on recordings: time constant, in seconds; charge over which it changes; charge that a point of the curve is displaced by;
/// its part of the sag.
const FINE_TAU_S: f64 = 3000.0;
const FINE_CHARGE: f64 = 0.08;
const FINE_SLOPE: f64 = 0.012;
const FINE_SAG: f64 = 0.08;

/// The sag's relative error, all chosen on recordings: its deviation, its time constant, in seconds, and the sag at which it has
/// doubled, in volts.
const SAG_SIGMA: f64 = 0.1;
const SAG_TAU_S: f64 = 1000.0;
const SAG_LARGE_V: f64 = 1.0;

/// Time in which slow shares and growth return to those of the pack, in seconds: chosen on recordings.
const SHARE_TAU_S: f64 = 6000.0;

/// Change of the resistance's logarithm in ten seconds, by warming: chosen on recordings.
const RESISTANCE_WALK: f64 = 0.01;

/// Deviation of a charge that may be anything: 1/√12.
const ANY_CHARGE: f64 = 0.29;

/// Resistance by steps of the load, chosen on recordings: noise of a reading, in volts; relative error; root of the sum of the squared steps of a block
/// that measures something, in capacities per hour; the least deviation of the logarithm; deviations by which an outlier pulls.
const STEP_NOISE_V: f64 = 0.003;
const STEP_RELATIVE: f64 = 0.25;
const STEP_LEAST_PER_H: f64 = 0.1;
const STEP_FLOOR: f64 = 0.02;
const STEP_OUTLIER: f64 = 3.0;
/// Less than this share of the typical resistance is none.
const STEP_LEAST_SHARE: f64 = 0.05;

/// Mean and deviation that slow shares and growth return to.
pub type Shape = [(f64, f64); 3];

/// By how much larger the error of a large sag is.
fn enlarged(sag_v: f64) -> f64 {
    1.0 + (sag_v / SAG_LARGE_V).min(1.0).powi(2)
}

/// Deviation of the curve's fine error at a charge under a sag, in volts.
pub fn fine_sigma_v(charge: f64, sag_v: f64, cell: &Cell) -> f64 {
    let by_sag_v = FINE_SAG * sag_v * enlarged(sag_v);
    let by_slope_v = FINE_SLOPE * cell.slope_v(charge);
    (cell.kind.white_v.powi(2) + by_sag_v.powi(2) + by_slope_v.powi(2)).sqrt()
}

/// The error of the sag changes with time.
pub fn drift_sag(gaussian: &mut Gaussian, duration_s: f64, sag_v: f64) {
    let sigma = SAG_SIGMA * enlarged(sag_v);
    gaussian.revert(SAG, (-duration_s / SAG_TAU_S).exp(), 0.0, sigma);
}

/// The shape of the sag returns to this one with time.
pub fn drift_shape(gaussian: &mut Gaussian, duration_s: f64, shape: &Shape) {
    for (number, (mean, sigma)) in shape.iter().enumerate() {
        let left = (1.0 - duration_s / SHARE_TAU_S).max(0.0);
        gaussian.revert(FAST + number, left, *mean, *sigma);
    }
}

/// The resistance changes with the temperature.
pub fn warm(gaussian: &mut Gaussian, duration_s: f64) {
    let variance = RESISTANCE_WALK * RESISTANCE_WALK * duration_s / 10.0;
    gaussian.covariance.add(RESISTANCE, RESISTANCE, variance);
}

/// A charge is drawn, in ampere-hours, within some time.
pub fn draw(gaussian: &mut Gaussian, charge_ah: f64, duration_s: f64, fine_sigma_v: f64, label_ah: f64) {
    let drawn = charge_ah / (label_ah * gaussian.mean[CAPACITY].exp());
    gaussian.mean[CHARGE] -= drawn;
    gaussian.covariance.add_state(CHARGE, drawn, CAPACITY);
    let left = (-duration_s / FINE_TAU_S - drawn.abs() / FINE_CHARGE).exp();
    gaussian.revert(FINE, left, 0.0, fine_sigma_v);
    let sigma = gaussian.sigma(CHARGE);
    if sigma > ANY_CHARGE {
        gaussian.covariance.scale(CHARGE, ANY_CHARGE / sigma);
    }
}

/// Takes the resistance that a block's steps from second to second show.
pub fn measure_resistance(gaussian: &mut Gaussian, block: &Block, cell: &Cell) {
    let is_small = block.steps <= (STEP_LEAST_PER_H * cell.label_ah).powi(2);
    let variance = gaussian.covariance.get(RESISTANCE, RESISTANCE);
    if is_small
        || block.steps_v <= STEP_LEAST_SHARE * cell.typical_ohm * block.steps
        || variance <= STEP_FLOOR * STEP_FLOOR
    {
        return;
    }
    let ohm = block.steps_v / block.steps;
    let noise = 2.0 * STEP_NOISE_V * STEP_NOISE_V / (block.steps * ohm * ohm) + STEP_RELATIVE * STEP_RELATIVE;
    let innovation = (ohm / cell.typical_ohm).ln() - gaussian.mean[RESISTANCE];
    let total = (variance + noise).max(innovation * innovation / (STEP_OUTLIER * STEP_OUTLIER));
    let with_resistance = gaussian.covariance.row(RESISTANCE);
    for (mean, covariance) in gaussian.mean.iter_mut().zip(with_resistance) {
        *mean += covariance / total * innovation;
    }
    gaussian.covariance.add_product(-1.0 / total, &with_resistance);
}
