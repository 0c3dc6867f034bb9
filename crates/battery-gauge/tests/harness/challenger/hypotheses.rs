//! Hypotheses about a start: found full or anywhere, with a label that is right or wrong.

use super::form::Form;
use super::states::{CAPACITY, CHARGE, Gaussian};

/// Deviation of the charge of a pack that has just been charged: a charger's end; chosen on recordings.
const FULL_SIGMA: f64 = 0.012;
/// A charge that may be anything.
const ANYWHERE: (f64, f64) = (0.5, 0.29);

/// Logarithm of the capacity over a label that is wrong: of an aged pack, rather than a better one; chosen on recordings.
const WRONG_LABEL: (f64, f64) = (-0.03, 0.2);
/// A capacity that is known to this needs no second hypothesis: chosen on recordings.
const KNOWN_CAPACITY_SIGMA: f64 = 0.04;

/// A hypothesis below this weight is dropped.
const LEAST_WEIGHT: f64 = 1e-4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    Full,
    Anywhere,
}

#[derive(Clone, Debug)]
pub struct Hypothesis {
    pub found: Found,
    /// Whether it starts from a rest; else the load before is unknown.
    pub has_rested: bool,
    pub gaussian: Gaussian,
    pub log_weight: f64,
    /// How far voltages were from what was expected lately, in deviations.
    pub surprise: f64,
    /// Share by which the pack is colder than its kept drives.
    pub cold: f64,
}

#[derive(Clone, Debug)]
pub struct Hypotheses(pub Vec<Hypothesis>);

impl Hypotheses {
    /// Of a pack that was kept, or is new.
    pub fn new(pack: &Gaussian, is_new: bool, form: &Form) -> Self {
        let right = form.right_label_weight;
        let (mean, sigma) = (pack.mean[CAPACITY], pack.sigma(CAPACITY));
        let (wrong_mean, wrong_sigma) = WRONG_LABEL;
        let mut capacities = Vec::new();
        if is_new {
            capacities.push((0.0, form.right_label_sigma, right));
            if right < 1.0 {
                capacities.push((wrong_mean, wrong_sigma, 1.0 - right));
            }
        } else {
            capacities.push((mean, sigma, right));
            if sigma >= KNOWN_CAPACITY_SIGMA {
                capacities.push((mean, sigma.hypot(wrong_sigma), 1.0 - right));
            }
        }
        let mut hypotheses = Vec::new();
        for (mean, sigma, share) in capacities {
            for (found, (charge, charge_sigma)) in
                [(Found::Full, (1.0, FULL_SIGMA)), (Found::Anywhere, ANYWHERE)]
            {
                let mut gaussian = pack.clone();
                gaussian.mean[CAPACITY] = mean;
                let more = sigma * sigma - gaussian.covariance.get(CAPACITY, CAPACITY);
                gaussian.covariance.add(CAPACITY, CAPACITY, more);
                gaussian.set(CHARGE, charge, charge_sigma);
                hypotheses.push(Hypothesis {
                    found,
                    has_rested: found == Found::Full,
                    gaussian,
                    log_weight: (0.5 * share).ln(),
                    surprise: 0.0,
                    cold: 0.0,
                });
            }
        }
        Self(hypotheses)
    }

    /// The likeliest.
    pub fn best(&self) -> &Hypothesis {
        let by_weight =
            |here: &&Hypothesis, there: &&Hypothesis| here.log_weight.total_cmp(&there.log_weight);
        self.0.iter().max_by(by_weight).expect("one is left")
    }

    /// Whether it is not known how it was found.
    pub fn is_open(&self) -> bool {
        self.weight_of(Found::Full) > 0.0 && self.weight_of(Found::Anywhere) > 0.0
    }

    pub fn weight_of(&self, found: Found) -> f64 {
        self.0
            .iter()
            .filter(|hypothesis| hypothesis.found == found)
            .map(|hypothesis| hypothesis.log_weight.exp())
            .sum()
    }

    /// Drops all that were not found like this.
    pub fn decide(&mut self, found: Found) {
        self.0.retain(|hypothesis| hypothesis.found == found);
        self.weigh();
    }

    /// Scales the weights to a sum of 1, and drops hypotheses that are unlikely.
    pub fn weigh(&mut self) {
        let best = self.best().log_weight;
        let sum: f64 = self
            .0
            .iter()
            .map(|hypothesis| (hypothesis.log_weight - best).exp())
            .sum();
        for hypothesis in &mut self.0 {
            hypothesis.log_weight -= best + sum.ln();
        }
        self.0
            .retain(|hypothesis| hypothesis.log_weight.exp() >= LEAST_WEIGHT);
    }

    fn shares(&self) -> impl Iterator<Item = (f64, &Gaussian)> + Clone {
        let total: f64 = self.0.iter().map(|hypothesis| hypothesis.log_weight.exp()).sum();
        self.0
            .iter()
            .map(move |hypothesis| (hypothesis.log_weight.exp() / total, &hypothesis.gaussian))
    }

    /// Charge and its deviation over all.
    pub fn charge(&self) -> (f64, f64) {
        let mean: f64 = self
            .shares()
            .map(|(share, gaussian)| share * gaussian.mean[CHARGE])
            .sum();
        let square: f64 = self
            .shares()
            .map(|(share, gaussian)| {
                share * (gaussian.covariance.get(CHARGE, CHARGE) + gaussian.mean[CHARGE].powi(2))
            })
            .sum();
        (mean, (square - mean.max(0.0).powi(2)).max(0.0).sqrt())
    }

    pub fn merged(&self) -> Gaussian {
        Gaussian::merged(self.shares())
    }
}
