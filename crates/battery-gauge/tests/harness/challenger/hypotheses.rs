//! Hypotheses about a start: found full or anywhere, with a label that is right or wrong.

use super::states::{CAPACITY, CHARGE, Gaussian};

/// Deviation of the charge of a pack that has just been charged: a charger's end; chosen on recordings.
pub const FULL_SIGMA: f64 = 0.012;
/// A charge that may be anything.
const ANYWHERE: (f64, f64) = (0.5, 0.29);

/// Deviation of the capacity's logarithm with a label that is right, and the weight of that hypothesis: chosen on recordings.
const RIGHT_LABEL_SIGMA: f64 = 0.07;
const RIGHT_LABEL_WEIGHT: f64 = 0.7;
/// Logarithm of the capacity over a label that is wrong: of an aged pack, rather than a better one; chosen on recordings.
const WRONG_LABEL: (f64, f64) = (-0.03, 0.2);
/// A capacity that is known to this needs no second hypothesis: chosen on recordings.
const KNOWN_CAPACITY_SIGMA: f64 = 0.04;

/// A hypothesis below this weight is dropped.
const LEAST_WEIGHT: f64 = 1e-4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    Full,
    /// Neither charged nor used since the last rest.
    AsLeft,
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
    /// Of a pack that was kept, or is new; `as_left`: the charge and its deviation, if it has the voltage of its last rest.
    pub fn new(pack: &Gaussian, is_new: bool, as_left: Option<(f64, f64)>) -> Self {
        let starts = [
            Some((Found::Full, (1.0, FULL_SIGMA))),
            Some((Found::Anywhere, ANYWHERE)),
            as_left.map(|charge| (Found::AsLeft, charge)),
        ];
        let mut hypotheses = Vec::new();
        for (mean, sigma, share) in Self::capacities(pack, is_new) {
            for (found, (charge, charge_sigma)) in starts.into_iter().flatten() {
                let mut gaussian = pack.clone();
                gaussian.mean[CAPACITY] = mean;
                let more = sigma * sigma - gaussian.covariance.get(CAPACITY, CAPACITY);
                gaussian.covariance.add(CAPACITY, CAPACITY, more);
                gaussian.set(CHARGE, charge, charge_sigma);
                hypotheses.push(Hypothesis {
                    found,
                    has_rested: found != Found::Anywhere,
                    gaussian,
                    log_weight: (0.5 * share).ln(),
                    surprise: 0.0,
                    cold: 0.0,
                });
            }
        }
        Self(hypotheses)
    }

    /// Means, deviations and weights of the logarithm of the capacity, with the label right and wrong.
    fn capacities(pack: &Gaussian, is_new: bool) -> Vec<(f64, f64, f64)> {
        let (mean, sigma) = (pack.mean[CAPACITY], pack.sigma(CAPACITY));
        let (wrong_mean, wrong_sigma) = WRONG_LABEL;
        let (right, wrong) = (RIGHT_LABEL_WEIGHT, 1.0 - RIGHT_LABEL_WEIGHT);
        if is_new {
            return vec![(0.0, RIGHT_LABEL_SIGMA, right), (wrong_mean, wrong_sigma, wrong)];
        }
        let mut capacities = vec![(mean, sigma, right)];
        if sigma >= KNOWN_CAPACITY_SIGMA {
            capacities.push((mean, sigma.hypot(wrong_sigma), wrong));
        }
        capacities
    }

    /// The likeliest.
    pub fn best(&self) -> &Hypothesis {
        let by_weight =
            |here: &&Hypothesis, there: &&Hypothesis| here.log_weight.total_cmp(&there.log_weight);
        self.0.iter().max_by(by_weight).expect("one is left")
    }

    /// Whether it is not known how it was found.
    pub fn is_open(&self) -> bool {
        let first = self.0[0].found;
        self.0.iter().any(|hypothesis| hypothesis.found != first)
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

    /// Drops all that were found like this.
    pub fn drop(&mut self, found: Found) {
        self.0.retain(|hypothesis| hypothesis.found != found);
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

    /// Weights and Gaussians of those found like this, or of all.
    fn shares(&self, found: Option<Found>) -> impl Iterator<Item = (f64, &Gaussian)> + Clone {
        let which = move |one: &&Hypothesis| found.is_none_or(|found| one.found == found);
        let total: f64 = self.0.iter().filter(which).map(|one| one.log_weight.exp()).sum();
        self.0
            .iter()
            .filter(which)
            .map(move |one| (one.log_weight.exp() / total, &one.gaussian))
    }

    /// Charge and its deviation over all.
    pub fn charge(&self) -> (f64, f64) {
        let mean: f64 = self
            .shares(None)
            .map(|(share, gaussian)| share * gaussian.mean[CHARGE])
            .sum();
        let square: f64 = self
            .shares(None)
            .map(|(share, gaussian)| {
                share * (gaussian.covariance.get(CHARGE, CHARGE) + gaussian.mean[CHARGE].powi(2))
            })
            .sum();
        (mean, (square - mean.max(0.0).powi(2)).max(0.0).sqrt())
    }

    /// Those found like the likeliest, as one.
    pub fn merged(&self) -> Gaussian {
        Gaussian::merged(self.shares(Some(self.best().found)))
    }
}
