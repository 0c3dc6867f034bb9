//! Voltage of a cell by its states.

use crate::chemistry::POINTS;

use super::kinds::{Kind, RESISTANCE_MEAN};
use super::states::{
    CHARGE, FAST, FINE, GROWTH, Gaussian, KNOT, KNOTS, RESISTANCE, SAG, SLOW, STATES, Vector,
};

const SEGMENTS: f64 = (POINTS - 1) as f64;

/// Below this charge the sag of a load grows: chosen on recordings.
const GROWS_BELOW: f64 = 0.4;

/// Slow parts of the sag grow in the cold by more than the fast one does, as a power of the resistance: diffusion by three to 0 °C
/// (Arrhenius, 35 kJ/mol), where resistance has grown by 2.2. So does the growth towards empty.
const COLD_POWER: f64 = 0.39;

/// A slope of less charge than this is that of a wiggle: chosen on recordings.
const WIGGLE: f64 = 0.05;

/// A cell with its label.
#[derive(Clone, Debug)]
pub struct Cell {
    pub kind: &'static Kind,
    curve_v: [f64; POINTS],
    pub label_ah: f64,
    /// Fast resistance of a typical cell of that size, in ohms.
    pub typical_ohm: f64,
    /// The mean of ten seconds that ends a drive, in volts.
    pub critical_v: f64,
}

/// A load now, and its fast and its slow mean, in amperes.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    pub now_a: f64,
    pub fast_a: f64,
    pub slow_a: f64,
}

/// The voltage as a function of the states near a Gaussian.
#[derive(Clone, Debug)]
pub struct Linear {
    /// Mean over the spread of the charge, in volts.
    pub mean_v: f64,
    /// Variance that the gradient does not explain.
    pub rest: f64,
    pub gradient: Vector,
}

impl Cell {
    pub fn new(kind: &'static Kind, label_ah: f64, critical_v: f64) -> Self {
        Self {
            kind,
            curve_v: kind.curve_v(),
            label_ah,
            typical_ohm: f64::from(kind.cell().ohmic_drop_v) / label_ah,
            critical_v,
        }
    }

    pub fn ohm(&self, states: &Vector) -> f64 {
        self.typical_ohm * states[RESISTANCE].exp()
    }

    /// Voltage of a typical cell at rest, continued below empty and above full.
    pub fn open_v(&self, charge: f64) -> f64 {
        let [first_v, second_v, ..] = self.curve_v;
        let [.., before_v, last_v] = self.curve_v;
        if charge <= 0.0 {
            return first_v + charge * (second_v - first_v) * SEGMENTS;
        }
        if charge >= 1.0 {
            return last_v + (charge - 1.0) * ((last_v - before_v) * SEGMENTS).max(1.0);
        }
        let segment = (charge * SEGMENTS) as usize;
        let (low_v, high_v) = (self.curve_v[segment], self.curve_v[segment + 1]);
        low_v + (charge * SEGMENTS - segment as f64) * (high_v - low_v)
    }

    /// A voltage at rest from here on is that of a full cell, in volts.
    pub fn full_v(&self) -> f64 {
        let [.., before_v, last_v] = self.curve_v;
        before_v + 0.2 * (last_v - before_v)
    }

    /// Slope of the curve, in volts.
    pub fn slope_v(&self, charge: f64) -> f64 {
        let (low, high) = ((charge - 0.03).max(-0.02), (charge + 0.03).min(1.0));
        (self.open_v(high) - self.open_v(low)) / (high - low)
    }

    /// Sag of a load at a charge without its relative error, in volts.
    pub fn sag_v(&self, charge: f64, states: &Vector, load: &Load) -> f64 {
        self.ohm(states) * weighted_a(states, load) * grown(charge, states)
    }

    /// Voltage at this charge with the other states.
    pub fn voltage_v(&self, charge: f64, states: &Vector, load: &Load) -> f64 {
        let (knot, towards) = knot_below(charge);
        let deviation_v = states[KNOT + knot] * (1.0 - towards) + states[KNOT + knot + 1] * towards;
        let sag_v = self.sag_v(charge, states, load) * (1.0 + states[SAG]);
        self.open_v(charge) + deviation_v - sag_v + states[FINE]
    }

    /// Voltage at this charge without a load, but for errors of the moment.
    pub fn resting_v(&self, charge: f64, states: &Vector) -> f64 {
        let (knot, towards) = knot_below(charge);
        self.open_v(charge) + states[KNOT + knot] * (1.0 - towards) + states[KNOT + knot + 1] * towards
    }

    /// The charge at which a sag, that grows towards empty, takes the voltage to critical.
    pub fn charge_under(&self, sag_v: f64, states: &Vector) -> f64 {
        let (mut low, mut high) = (-0.02, 1.0);
        for _ in 0..14 {
            let middle = 0.5 * (low + high);
            if self.resting_v(middle, states) - sag_v * grown(middle, states) < self.critical_v {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Statistical linearisation over a deviation of the charge.
    pub fn linearised(&self, at: &Vector, charge_sigma: f64, load: &Load) -> Linear {
        let sigma = charge_sigma.max(0.004);
        let reach = 3.0_f64.sqrt() * sigma;
        let charge = at[CHARGE];
        let voltage_v = |charge: f64| self.voltage_v(charge, at, load);
        let (here_v, up_v, down_v) = (
            voltage_v(charge),
            voltage_v(charge + reach),
            voltage_v(charge - reach),
        );
        let mean_v = (4.0 * here_v + up_v + down_v) / 6.0;
        let mut slope_v = (up_v - down_v) / (2.0 * reach);
        let square = |voltage_v: f64| (voltage_v - mean_v) * (voltage_v - mean_v);
        let spread = (4.0 * square(here_v) + square(up_v) + square(down_v)) / 6.0;
        let rest = (spread - (slope_v * sigma) * (slope_v * sigma)).max(0.0);
        if reach < WIGGLE {
            slope_v = (voltage_v(charge + WIGGLE) - voltage_v(charge - WIGGLE)) / (2.0 * WIGGLE);
        }
        Linear {
            mean_v,
            rest,
            gradient: self.gradient(at, slope_v, load),
        }
    }

    fn gradient(&self, at: &Vector, slope_v: f64, load: &Load) -> Vector {
        let mut gradient = [0.0; STATES];
        let (error, by_cold) = (1.0 + at[SAG], slowed_by_cold(at));
        let (grows, grown) = (growth(at[CHARGE]) * by_cold, grown(at[CHARGE], at));
        let (ohm, total_a) = (self.ohm(at), weighted_a(at, load));
        let slow_a = by_cold * load.slow_a;
        // What the resistance changes, itself and by what the cold slows.
        let by_slow_a = COLD_POWER * at[SLOW] * slow_a * grown;
        let by_growth_a = COLD_POWER * total_a * at[GROWTH] * grows;
        gradient[CHARGE] = slope_v;
        gradient[RESISTANCE] = -ohm * error * (total_a * grown + by_slow_a + by_growth_a);
        gradient[FAST] = -ohm * error * load.fast_a * grown;
        gradient[SLOW] = -ohm * error * slow_a * grown;
        gradient[GROWTH] = -ohm * error * total_a * grows;
        gradient[FINE] = 1.0;
        gradient[SAG] = -ohm * total_a * grown;
        let (knot, towards) = knot_below(at[CHARGE]);
        gradient[KNOT + knot] = 1.0 - towards;
        gradient[KNOT + knot + 1] = towards;
        gradient
    }

    /// Slope of the chord to where the curve has this voltage; `None` if that is near, where a tangent does.
    pub fn chord_v(&self, at: &Vector, voltage_v: f64, reach: f64, load: &Load) -> Option<f64> {
        let charge = at[CHARGE];
        let here_v = self.voltage_v(charge, at, load);
        let (mut low, mut high) = if voltage_v > here_v {
            (charge, (charge + reach).min(1.05))
        } else {
            ((charge - reach).max(-0.1), charge)
        };
        for _ in 0..8 {
            let middle = 0.5 * (low + high);
            if self.voltage_v(middle, at, load) < voltage_v {
                low = middle;
            } else {
                high = middle;
            }
        }
        let there = 0.5 * (low + high);
        let is_far = (there - charge).abs() >= WIGGLE;
        is_far.then(|| (self.voltage_v(there, at, load) - here_v) / (there - charge))
    }

    /// The charge at which a load ends a drive, and the gradient of the charge less it.
    pub fn ending_charge(&self, gaussian: &Gaussian, load: &Load) -> (f64, Vector) {
        let states = &gaussian.mean;
        let voltage_v = |charge: f64| self.voltage_v(charge, states, load);
        let (mut low, mut high) = (-0.02, 1.0);
        for _ in 0..14 {
            let middle = 0.5 * (low + high);
            if voltage_v(middle) - states[FINE].max(0.0) < self.critical_v {
                low = middle;
            } else {
                high = middle;
            }
        }
        let end = 0.5 * (low + high);
        let slope_v = ((voltage_v(end + 0.01) - voltage_v(end - 0.01)) / 0.02).max(0.05);
        let ending = Vector::from(std::array::from_fn(|state| {
            if state == CHARGE { end } else { states[state] }
        }));
        let mut gradient = self.gradient(&ending, slope_v, load).map(|part| -part / slope_v);
        gradient[CHARGE] = 1.0;
        gradient[FINE] = 0.0;
        gradient[SAG] = 0.0;
        (end, gradient)
    }
}

/// Share by which the sag has grown: 0 above, 1 at empty.
fn growth(charge: f64) -> f64 {
    let below = (1.0 - charge / GROWS_BELOW).clamp(0.0, 1.0);
    below * below
}

/// The sag over that of a fuller cell.
pub fn grown(charge: f64, states: &Vector) -> f64 {
    1.0 + states[GROWTH] * slowed_by_cold(states) * growth(charge)
}

/// Factor of all that the cold slows.
fn slowed_by_cold(states: &Vector) -> f64 {
    (COLD_POWER * (states[RESISTANCE] - RESISTANCE_MEAN)).exp()
}

/// The current whose fast sag is that of the whole load, in amperes.
fn weighted_a(states: &Vector, load: &Load) -> f64 {
    load.now_a + states[FAST] * load.fast_a + states[SLOW] * slowed_by_cold(states) * load.slow_a
}

/// The knot below a charge, and the way from it to the next.
fn knot_below(charge: f64) -> (usize, f64) {
    let knot = KNOTS
        .partition_point(|knot| *knot < charge)
        .saturating_sub(1)
        .min(KNOTS.len() - 2);
    let (low, high) = (KNOTS[knot], KNOTS[knot + 1]);
    (knot, ((charge - low) / (high - low)).clamp(0.0, 1.0))
}
