//! What is known of a chemistry before a pack of it is seen.

use crate::chemistry::{self, POINTS};

use super::covariance::Covariance;
use super::states::{CAPACITY, FAST, GROWTH, Gaussian, KNOT, KNOTS, RESISTANCE, SLOW, STATES, Vector};

/// A mean and its standard deviation.
type Known = (f64, f64);

/// Spread of makes. Li-ion's middle is the crate's; all others were chosen on recordings.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    pub chemistry: battery_gauge::Chemistry,
    /// Spread of makes about the curve in its middle and at full, in volts.
    middle_v: f64,
    top_v: f64,
    /// Share of the sag with 10 and 100 s, and with 1000 s.
    fast: Known,
    slow: Known,
    /// Error of the curve between its points, in volts.
    pub white_v: f64,
}

const KINDS: [Kind; 4] = [
    Kind {
        chemistry: battery_gauge::Chemistry::LiPo,
        middle_v: 0.045,
        top_v: 0.02,
        fast: (0.25, 0.5),
        slow: (0.25, 0.3),
        white_v: 0.015,
    },
    Kind {
        chemistry: battery_gauge::Chemistry::LiFe,
        middle_v: 0.018,
        top_v: 0.05,
        fast: (0.5, 0.7),
        slow: (0.5, 0.5),
        white_v: 0.0075,
    },
    Kind {
        chemistry: battery_gauge::Chemistry::LiIon,
        middle_v: 0.055,
        top_v: 0.02,
        fast: (0.8, 0.8),
        slow: (0.8, 0.5),
        white_v: 0.015,
    },
    Kind {
        chemistry: battery_gauge::Chemistry::NiMh,
        middle_v: 0.045,
        top_v: 0.05,
        fast: (0.5, 0.7),
        slow: (0.5, 0.5),
        white_v: 0.015,
    },
];

/// Fast resistance of a pack over that of a typical cell, logarithm: leads and contacts add to the cell, cold and age spread it;
/// chosen on recordings.
pub const RESISTANCE_MEAN: f64 = 0.262_364_264_467_491;
const RESISTANCE_SIGMA: f64 = 0.8;

/// Growth of the sag towards empty, relative: chosen on recordings.
const GROWTH_KNOWN: Known = (1.2, 0.7);

/// Charge over which the deviation of a make is correlated: chosen on recordings.
const KNOT_REACH: f64 = 0.4;

/// Charge that a point of the curve may be displaced by, in the steep part below a fifth, and its share above: chosen on recordings.
const KNOT_CHARGE: f64 = 0.012;
const STEEP_BELOW: f64 = 0.2;
const FLAT_SHARE: f64 = 0.3;
/// Deviation of a knot apart from its neighbours, in volts: chosen on recordings.
const KNOT_OWN_V: f64 = 0.003;

/// Deviation of a cell along the difference of LiPo and Li-ion, which are sold under each other's names: chosen on recordings.
const FAMILY: f64 = 0.4;

impl Kind {
    pub fn of(chemistry: battery_gauge::Chemistry) -> &'static Self {
        let is_it = |kind: &&Self| kind.chemistry == chemistry;
        KINDS.iter().find(is_it).expect("each chemistry is a kind")
    }

    pub fn cell(&self) -> &'static chemistry::Cell {
        crate_cell(self.chemistry)
    }

    pub fn curve_v(&self) -> [f64; POINTS] {
        self.cell().curve.0.map(f64::from)
    }

    /// A pack that was never seen; charge and capacity are those of a hypothesis.
    pub fn prior(&self) -> Gaussian {
        let mut prior = Gaussian {
            mean: [0.0; STATES],
            covariance: Covariance::ZERO,
        };
        prior.set(CAPACITY, 0.0, 0.0);
        prior.set(RESISTANCE, RESISTANCE_MEAN, RESISTANCE_SIGMA);
        for (state, (mean, sigma)) in [(FAST, self.fast), (SLOW, self.slow), (GROWTH, GROWTH_KNOWN)] {
            prior.set(state, mean, sigma);
        }
        self.add_spread_of_makes(&mut prior.covariance);
        prior
    }

    fn add_spread_of_makes(&self, covariance: &mut Covariance) {
        let curve = self.curve_v();
        let sigma_v = KNOTS.map(|knot| self.make_sigma_v(knot));
        for (row, here) in KNOTS.iter().enumerate() {
            for (column, there) in KNOTS.iter().enumerate().take(row + 1) {
                let alike = (-(here - there).abs() / KNOT_REACH).exp();
                covariance.add(KNOT + row, KNOT + column, sigma_v[row] * sigma_v[column] * alike);
            }
            let (low, high) = ((here - 0.03).max(0.0), (here + 0.03).min(1.0));
            let slope_v = (along(&curve, high) - along(&curve, low)) / (high - low);
            let share = if *here < STEEP_BELOW { 1.0 } else { FLAT_SHARE };
            let own_v = share * KNOT_CHARGE * slope_v;
            covariance.add(KNOT + row, KNOT + row, own_v * own_v + KNOT_OWN_V * KNOT_OWN_V);
        }
        if let Some(other_v) = self.towards_the_other_family() {
            covariance.add_product(FAMILY * FAMILY, &other_v);
        }
    }

    fn make_sigma_v(&self, charge: f64) -> f64 {
        let half_v = 0.5 * (self.middle_v + self.top_v);
        if charge <= 0.8 {
            self.middle_v
        } else if charge <= 0.92 {
            self.middle_v + (charge - 0.8) / 0.12 * (half_v - self.middle_v)
        } else {
            half_v + (charge - 0.92) / 0.08 * (self.top_v - half_v)
        }
    }

    fn towards_the_other_family(&self) -> Option<Vector> {
        use battery_gauge::Chemistry::{LiIon, LiPo};
        if !matches!(self.chemistry, LiPo | LiIon) {
            return None;
        }
        let [polymer, ion] = [LiPo, LiIon].map(|chemistry| Self::of(chemistry).curve_v());
        let mut difference_v = [0.0; STATES];
        for (number, knot) in KNOTS.iter().enumerate() {
            difference_v[KNOT + number] = along(&polymer, *knot) - along(&ion, *knot);
        }
        Some(difference_v)
    }
}

/// A curve's voltage at a charge from 0 to 1.
fn along(curve_v: &[f64; POINTS], charge: f64) -> f64 {
    let position = charge.clamp(0.0, 1.0) * (POINTS - 1) as f64;
    let segment = (position as usize).min(POINTS - 2);
    let (low_v, high_v) = (curve_v[segment], curve_v[segment + 1]);
    low_v + (position - segment as f64) * (high_v - low_v)
}

fn crate_cell(chemistry: battery_gauge::Chemistry) -> &'static chemistry::Cell {
    let found = chemistry::Chemistry::from_number(chemistry as i32);
    found.expect("the crate's own").cell()
}
