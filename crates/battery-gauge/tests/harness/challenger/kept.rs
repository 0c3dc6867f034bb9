//! What is kept of a pack over power cycles.

use super::hypotheses::Found;
use super::kinds::Kind;
use super::power_cycle::PowerCycle;
use super::predict::Shape;
use super::states::{CAPACITY, CHARGE, FAST, FINE, GROWTH, Gaussian, KNOT, KNOTS, RESISTANCE, SAG, SLOW};
use super::usable::Collapse;

/// All chosen on recordings: deviations that come with the charge of a drive, of the logarithms of capacity and resistance, the slow shares and
/// the knots, in volts; share by which slow shares and curve return to the chemistry's.
const DRIVE_CAPACITY: f64 = 0.03;
const DRIVE_RESISTANCE: f64 = 0.3;
const DRIVE_SHARE: f64 = 0.08;
const DRIVE_KNOT_V: f64 = 0.003;
const DRIVE_FORGETS: f64 = 0.02;
/// Charge over which changes of the curve are alike: chosen on recordings.
const DRIVE_KNOT_REACH: f64 = 0.25;

/// Share by which slow shares return to those of the pack within a drive, not to the chemistry's: chosen on recordings.
const OWN_SHARE: f64 = 0.5;
/// Most that the logarithm of the warm resistance rises in a drive: chosen on recordings.
const WARM_RISE: f64 = 0.02;

/// A pack that was not found full, and whose voltages were this far from what was expected, in deviations, is forgotten: a fault of
/// the sensor was learnt, or it is another pack. Assumed.
const FORGOTTEN_FROM: f64 = 1.5;

#[derive(Clone, Debug)]
pub struct Kept {
    kind: &'static Kind,
    label_ah: f64,
    pub gaussian: Gaussian,
    /// Drives that have taught it.
    pub drives: u32,
    /// Logarithm of the resistance in warm drives.
    warm: f64,
    pub collapse: Option<Collapse>,
    /// Charge drawn since it was last learnt, relative to the capacity.
    drawn: f64,
    /// The last rest.
    pub last: Option<LastRest>,
}

/// A charge at rest with its voltage.
#[derive(Clone, Copy, Debug)]
pub struct LastRest {
    pub voltage_v: f64,
    pub charge: f64,
    pub sigma: f64,
}

/// What a drive returns to.
#[derive(Clone, Debug)]
pub struct PackShape {
    pub own: Shape,
    pub usual: Shape,
    /// Resistance in warm drives relative to a typical one, if it is known.
    pub warm: Option<f64>,
}

impl Kept {
    pub fn new(kind: &'static Kind, label_ah: f64) -> Self {
        Self {
            kind,
            label_ah,
            gaussian: kind.prior(),
            drives: 0,
            warm: 0.0,
            collapse: None,
            drawn: 0.0,
            last: None,
        }
    }

    /// With another label, or nothing with another chemistry.
    pub fn with(mut self, kind: &'static Kind, label_ah: f64) -> Self {
        if kind.chemistry != self.kind.chemistry {
            return Self::new(kind, label_ah);
        }
        let larger = (label_ah / self.label_ah).ln();
        self.label_ah = label_ah;
        if self.drives > 0 {
            self.gaussian.mean[CAPACITY] -= larger;
            self.gaussian.mean[RESISTANCE] += larger;
            self.warm += larger;
        }
        self
    }

    pub fn capacity_ah(&self) -> Option<f64> {
        (self.drives > 0).then(|| self.label_ah * self.gaussian.mean[CAPACITY].exp())
    }

    /// With what a drive has taught; of an unknown start, only the resistance.
    pub fn after(&self, cycle: &PowerCycle) -> Self {
        let merged = cycle.hypotheses.merged();
        let resistance = merged.mean[RESISTANCE];
        let mut kept = self.clone();
        let capacity_ah = self.label_ah * merged.mean[CAPACITY].exp();
        let is_full = cycle.hypotheses.best().found == Found::Full;
        let drawn_before = if is_full { 0.0 } else { self.drawn };
        kept.drawn = drawn_before + (cycle.drawn_ah / capacity_ah).clamp(0.0, 1.0);
        kept.last = cycle.last_rest;
        kept.warm = if kept.drives > 0 {
            resistance.min(self.warm + WARM_RISE)
        } else {
            resistance
        };
        if is_full {
            kept.gaussian = merged;
            kept.drives += 1;
        } else if cycle.worst_surprise > FORGOTTEN_FROM {
            return Self::new(self.kind, self.label_ah);
        } else {
            kept.gaussian.mean[RESISTANCE] = resistance;
        }
        let loads = &cycle.loads;
        let is_passed = |collapse: &Collapse| loads.least <= collapse.charge;
        kept.collapse = match loads.collapse.filter(|collapse| collapse.charge > 0.0) {
            Some(collapse) => Some(collapse.kept()),
            None => self.collapse.filter(|collapse| !is_passed(collapse)),
        };
        kept
    }

    /// At the start of a drive, with what may have changed since.
    pub fn started(&self) -> Gaussian {
        let mut gaussian = self.gaussian.clone();
        if self.drives > 0 {
            self.age(&mut gaussian);
        }
        gaussian.set(CHARGE, 0.0, 0.0);
        gaussian.set(FINE, 0.0, 0.001);
        gaussian.set(SAG, 0.0, 0.001);
        gaussian
    }

    /// What ages grows by the charge that was drawn since; the resistance changes with the temperature of a day.
    fn age(&self, gaussian: &mut Gaussian) {
        let covariance = &mut gaussian.covariance;
        covariance.add(RESISTANCE, RESISTANCE, DRIVE_RESISTANCE * DRIVE_RESISTANCE);
        for (state, sigma) in [
            (CAPACITY, DRIVE_CAPACITY),
            (FAST, DRIVE_SHARE),
            (SLOW, DRIVE_SHARE),
        ] {
            covariance.add(state, state, sigma * sigma * self.drawn);
        }
        for (row, here) in KNOTS.iter().enumerate() {
            for (column, there) in KNOTS.iter().enumerate().take(row + 1) {
                let apart = (here - there) / DRIVE_KNOT_REACH;
                let alike = (-0.5 * apart * apart).exp();
                let variance = DRIVE_KNOT_V * DRIVE_KNOT_V * alike * self.drawn;
                covariance.add(KNOT + row, KNOT + column, variance);
            }
        }
        self.forget(gaussian);
    }

    /// Slow shares and curve return towards the chemistry's.
    fn forget(&self, gaussian: &mut Gaussian) {
        let Gaussian { mean, covariance } = gaussian;
        let new = self.kind.prior();
        let stays = 1.0 - (DRIVE_FORGETS * self.drawn).min(1.0);
        for (mean, usual) in mean[FAST..FINE].iter_mut().zip(&new.mean[FAST..FINE]) {
            *mean = usual + stays * (*mean - usual);
        }
        for state in (FAST..FINE).chain(KNOT..KNOT + KNOTS.len()) {
            covariance.scale(state, stays);
        }
        for row in FAST..KNOT + KNOTS.len() {
            for column in FAST..=row {
                covariance.add(
                    row,
                    column,
                    (1.0 - stays * stays) * new.covariance.get(row, column),
                );
            }
        }
    }

    pub fn shape(&self) -> PackShape {
        let prior = self.kind.prior();
        let usual = [FAST, SLOW, GROWTH].map(|state| (prior.mean[state], prior.sigma(state)));
        let mut own = usual;
        if self.drives > 0 {
            let started = self.started();
            for (number, share) in [OWN_SHARE, OWN_SHARE, 1.0].into_iter().enumerate() {
                own[number].0 += share * (started.mean[FAST + number] - own[number].0);
            }
        }
        PackShape {
            own,
            usual,
            warm: (self.drives > 0).then(|| self.warm.exp()),
        }
    }
}
