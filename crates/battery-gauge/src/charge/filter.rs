//! A Kalman filter for the charge of a cell whose current is measured.

use super::cell_model::{Capacity, CellModel, KnownCharge};
use super::load::{Block, Load};

/// The states: state of charge; relative error of the inverse capacity; offset of the curve, in its standard deviations;
/// slow sag relative to the fast one.
const STATES: usize = 4;
type Vector = [f32; STATES];
type Matrix = [Vector; STATES];

/// Charge over which the offset of a curve changes: that of neighbouring parts is alike.
pub const OFFSET_SPAN: f32 = 0.3;

/// A curve on which a voltage gives the charge to this standard deviation is steep.
pub const STEEP_SIGMA: f32 = 0.12;

/// Time in which the slow share returns to what is typical, in seconds: it was seen at another load.
const SLOW_SHARE_TIME_CONSTANT_S: f32 = 3000.0;

/// Standard deviation of a voltage, in volts: noise of the board, and of a sag relative to it.
const NOISE_V: f32 = 0.008;
pub const SAG_NOISE: f32 = 0.1;
/// A sag above this, in volts, is predicted much worse: the cell is nearly empty or cold.
const LARGE_SAG_V: f32 = 0.3;

/// No cell has a larger sag, in volts.
const MAX_SAG_V: f32 = 5.0;

/// Errors of the model last for minutes: this many measurements are as good as one.
const CORRELATED_STEPS: f32 = 50.0;

/// An estimate that starts more certain than this is counted. A voltage corrects it by what is beyond a dead band: one
/// standard deviation of the voltage at this uncertainty, and inversely more or fewer at a smaller or larger one.
const COUNTED_SIGMA: f32 = 0.035;

/// Limits of the states.
const MIN_SOC: f32 = -0.02;
const MAX_OFFSET: f32 = 2.0;
const MAX_SLOW_SHARE: f32 = 4.0;
const MAX_CAPACITY_ERROR: f32 = 0.6;

/// Limit of a standard deviation of the state of charge: that of any charge being as likely.
const MAX_SIGMA: f32 = 0.29;
const MAX_VARIANCE: f32 = MAX_SIGMA * MAX_SIGMA;

/// The estimate with its covariance.
#[derive(Clone, Copy, Debug)]
pub struct Filter {
    state: Vector,
    covariance: Matrix,
    /// Lower limit of the variance of an estimate that started from a voltage, whose errors, those of curve and sag, do not
    /// average out: the variance that a voltage gives at this charge and lasting load. `None` if it started from a charge
    /// that was certain, from which the current is counted.
    voltage_variance: Option<f32>,
}

impl Filter {
    /// With this state of charge and standard deviation.
    pub fn from_soc(soc: f32, sigma: f32, model: &CellModel, capacity: &Capacity) -> Self {
        let mut covariance = typical_covariance(model, capacity);
        covariance[0][0] = square(sigma);
        Self {
            state: [soc, 0.0, 0.0, model.slow_share()],
            covariance,
            voltage_variance: if sigma < COUNTED_SIGMA { None } else { Some(0.0) },
        }
    }

    /// With this state of charge and standard deviation, counted from a charge that was certain, however little of the drawn one
    /// is.
    pub fn counted_to(soc: f32, sigma: f32, model: &CellModel, capacity: &Capacity) -> Self {
        Self {
            voltage_variance: None,
            ..Self::from_soc(soc, sigma, model, capacity)
        }
    }

    /// From the voltage of a cell under this load: what is unknown of curve and sag is unknown of the charge.
    pub fn from_voltage(load: &Load, cell_v: f32, model: &CellModel, capacity: &Capacity) -> Self {
        let sag = Sag::new(load, model.resistance_ohm(capacity));
        let soc = model.soc(cell_v + sag.at(model.slow_share()));
        let mut filter = Self::from_soc(soc, 0.0, model, capacity);
        let error = VoltageError::new(soc, &sag, model);
        let variance = error.variance();
        filter.covariance[0][0] = variance;
        filter.voltage_variance = Some(variance);
        if variance < MAX_VARIANCE {
            filter.set_covariance(2, error.by_offset);
            filter.set_covariance(3, error.by_slow_share * error.slow_variance);
        }
        filter
    }

    fn set_covariance(&mut self, with: usize, value: f32) {
        self.covariance[0][with] = value;
        self.covariance[with][0] = value;
    }

    /// State of charge.
    pub fn soc(&self) -> f32 {
        self.state[0]
    }

    /// Standard deviation of the state of charge.
    pub fn sigma(&self) -> f32 {
        libm::sqrtf(self.covariance[0][0].max(self.voltage_variance.unwrap_or(0.0)))
    }

    /// State of charge with its standard deviation.
    pub fn charge(&self) -> KnownCharge {
        KnownCharge {
            soc: self.soc(),
            sigma: self.sigma(),
        }
    }

    /// Capacity relative to the assumed one, the curve's offset in volts, and the slow share, each with its standard deviation.
    pub fn corrections(&self, model: &CellModel) -> [(f32, f32); 3] {
        let [soc, inverse_capacity, offset, slow_share] = self.state;
        let sigma = |index: usize| libm::sqrtf(self.covariance[index][index]);
        let offset_v = model.curve_sigma_v(soc, model.slope_v(soc));
        [
            (1.0 / (1.0 + inverse_capacity), sigma(1)),
            (offset * offset_v, sigma(2) * offset_v),
            (slow_share, sigma(3)),
        ]
    }

    /// A charge was drawn, in capacities.
    pub fn draw(&mut self, drawn: f32) {
        self.state[0] -= drawn;
    }

    /// A charge with this standard deviation, in capacities, was drawn unseen.
    pub fn inflate(&mut self, sigma: f32) {
        self.covariance[0][0] = (self.covariance[0][0] + square(sigma)).min(MAX_VARIANCE);
    }

    /// Up to this charge more, in capacities, was drawn unseen, as in all that was so before: these errors add up.
    pub fn widen(&mut self, share: f32) {
        let sigma = libm::sqrtf(self.covariance[0][0]) + share;
        self.covariance[0][0] = square(sigma).min(MAX_VARIANCE);
    }

    /// Factor by which a drawn charge counts.
    pub fn counted(&self) -> f32 {
        1.0 + self.state[1]
    }

    /// Takes a block: counts its charge, and corrects the estimate by its voltage, if that was measured. Returns by how many
    /// standard deviations the voltage exceeds the expected one.
    pub fn update(&mut self, block: &Block, model: &CellModel, capacity: &Capacity) -> Option<f32> {
        let drawn = block.load.drawn_ah() / capacity.ah;
        self.predict(drawn, block.load.duration_s, model);
        let deviations = block.cell_v.map(|cell_v| {
            let sag = Sag::new(&block.load, model.resistance_ohm(capacity));
            self.correct(cell_v, &sag, 0.5 * drawn, model)
        });
        self.limit();
        deviations
    }

    /// Limits the estimate to this deviation from a state of charge.
    pub fn keep_within(&mut self, soc: f32, deviation: f32) {
        self.state[0] = self.state[0].max(soc - deviation).min(soc + deviation);
    }

    /// Takes the current averaged over the longest time, on which the error of a voltage depends.
    pub fn update_voltage_variance(&mut self, lasting_a: f32, model: &CellModel, capacity: &Capacity) {
        let soc = self.soc();
        if let Some(variance) = &mut self.voltage_variance {
            let load = Load {
                current_a: lasting_a,
                slow_a: lasting_a,
                ..Load::NONE
            };
            let sag = Sag::new(&load, model.resistance_ohm(capacity));
            *variance = VoltageError::new(soc, &sag, model).variance();
        }
    }

    /// Whether its errors are those of a voltage.
    pub fn is_from_voltage(&self) -> bool {
        self.voltage_variance.is_some()
    }

    /// Takes the estimate by the voltage of a cell at rest as one measurement: it has errors of curve and slow sag that no other
    /// voltage of this rest averages out. An estimate that it corrects by more than half is one from a voltage.
    pub fn rest(&mut self, by_voltage: &Self) {
        let (variance, voltage_variance) = (square(self.sigma()), square(by_voltage.sigma()));
        let innovation = by_voltage.soc() - self.soc();
        let total = variance + voltage_variance;
        let weight = if variance < voltage_variance {
            self.weight(innovation / libm::sqrtf(total))
        } else {
            1.0
        };
        let gain = weight * variance / total;
        self.state[0] += gain * innovation;
        for with in 1..STATES {
            self.set_covariance(with, (1.0 - gain) * self.covariance[0][with]);
        }
        self.covariance[0][0] = variance * (1.0 - gain);
        if gain > 0.5 {
            self.voltage_variance = Some(voltage_variance);
        }
        self.limit();
    }

    fn predict(&mut self, drawn: f32, dt_s: f32, model: &CellModel) {
        self.state[0] -= drawn * self.counted();
        // Part of the error of the charge that comes from that of the capacity.
        let by_capacity = self.covariance[1];
        for (with, covariance) in by_capacity.into_iter().enumerate() {
            self.covariance[0][with] -= drawn * covariance;
        }
        for row in &mut self.covariance {
            row[0] -= drawn * row[1];
        }
        self.decay(2, 1.0 - (drawn.abs() / OFFSET_SPAN).min(1.0), 0.0, 1.0);
        self.decay(
            3,
            1.0 - (dt_s / SLOW_SHARE_TIME_CONSTANT_S).min(1.0),
            model.slow_share(),
            square(model.slow_share_sigma()),
        );
    }

    /// State `index` returns to its mean; `retained` is what is left of the deviation.
    fn decay(&mut self, index: usize, retained: f32, mean: f32, variance: f32) {
        self.state[index] = mean + (self.state[index] - mean) * retained;
        for covariance in &mut self.covariance[index] {
            *covariance *= retained;
        }
        for row in &mut self.covariance {
            row[index] *= retained;
        }
        self.covariance[index][index] += (1.0 - square(retained)) * variance;
    }

    /// Corrects by the voltage of a cell, when `since` of its charge had not been drawn yet. Returns by how many standard
    /// deviations it exceeds the expected one.
    fn correct(&mut self, cell_v: f32, sag: &Sag, since: f32, model: &CellModel) -> f32 {
        let [soc, _, offset, slow_share] = self.state;
        let soc = soc + since;
        let slope_v = model.slope_v(soc);
        let curve_sigma_v = model.curve_sigma_v(soc, slope_v);
        let resting_v = model.voltage_v(soc);
        let noise = noise_variance(sag.at(slow_share));
        let typical_variance = square(slope_v) * self.covariance[0][0]
            + square(curve_sigma_v)
            + square(sag.slow_v * model.slow_share_sigma())
            + noise;
        let unexplained_v = cell_v - (resting_v - sag.at(model.slow_share()));
        let deviations = unexplained_v / libm::sqrtf(typical_variance);
        let innovation_v = cell_v - (resting_v + curve_sigma_v * offset - sag.at(slow_share));
        let gradient = [slope_v, 0.0, curve_sigma_v, -sag.slow_v];
        let weight = self.weight(deviations);
        self.apply(&gradient, innovation_v, noise * CORRELATED_STEPS, weight);
        deviations
    }

    /// Weight of a voltage that is this many standard deviations off. The more certain the count, the less of the voltage
    /// counts: errors of a curve do not average out.
    fn weight(&self, deviations: f32) -> f32 {
        if self.voltage_variance.is_some() {
            return 1.0;
        }
        let dead_band = COUNTED_SIGMA / self.sigma();
        (1.0 - dead_band / deviations.abs().max(dead_band)).max(0.0)
    }

    /// The Kalman update, with a weight from 0 to 1.
    fn apply(&mut self, gradient: &Vector, innovation_v: f32, noise: f32, weight: f32) {
        let by_state = self.covariance.map(|row| dot(&row, gradient));
        let variance = dot(&by_state, gradient) + noise;
        for ((state, row), covariance) in self.state.iter_mut().zip(&mut self.covariance).zip(by_state) {
            let gain = weight * covariance / variance;
            *state += gain * innovation_v;
            for (element, covariance) in row.iter_mut().zip(by_state) {
                *element -= gain * covariance;
            }
        }
    }

    fn limit(&mut self) {
        let [soc, capacity_error, offset, slow_share] = &mut self.state;
        *soc = soc.clamp(MIN_SOC, 1.0);
        *capacity_error = capacity_error.clamp(-MAX_CAPACITY_ERROR, MAX_CAPACITY_ERROR);
        *offset = offset.clamp(-MAX_OFFSET, MAX_OFFSET);
        *slow_share = slow_share.clamp(0.0, MAX_SLOW_SHARE);
        for (index, row) in self.covariance.iter_mut().enumerate() {
            row[index] = row[index].max(1e-8);
        }
        if self.covariance[0][0] > MAX_VARIANCE {
            let shrink = MAX_SIGMA / libm::sqrtf(self.covariance[0][0]);
            for element in &mut self.covariance[0] {
                *element *= shrink;
            }
            for row in &mut self.covariance {
                row[0] *= shrink;
            }
        }
    }
}

/// The voltage that a load takes off.
#[derive(Clone, Copy, Debug)]
struct Sag {
    /// The immediate part, in volts.
    fast_v: f32,
    /// The slow part, if it is as large as the immediate one, in volts.
    slow_v: f32,
}

impl Sag {
    fn new(load: &Load, ohm: f32) -> Self {
        let limit = |voltage_v: f32| voltage_v.clamp(-MAX_SAG_V, MAX_SAG_V);
        Self {
            fast_v: limit(ohm * load.current_a),
            slow_v: limit(ohm * load.slow_a),
        }
    }

    /// The sag with this slow share, in volts.
    fn at(&self, slow_share: f32) -> f32 {
        self.fast_v + self.slow_v * slow_share
    }
}

/// Error of a charge that is read from a voltage, by the slope of the curve there.
struct VoltageError {
    by_offset: f32,
    by_slow_share: f32,
    slow_variance: f32,
    noise: f32,
}

impl VoltageError {
    fn new(soc: f32, sag: &Sag, model: &CellModel) -> Self {
        let slope_v = model.slope_v(soc);
        let sigma_v = model.curve_sigma_v(soc, slope_v);
        // Beside a plateau a voltage that is a little off is that of any charge there.
        let resting_v = model.voltage_v(soc);
        let lower = soc - model.soc(resting_v - sigma_v);
        let upper = model.soc(resting_v + sigma_v) - soc;
        let beside = if has_plateau(model) {
            upper.max(lower)
        } else {
            lower
        };
        Self {
            by_offset: -beside.max(sigma_v / slope_v),
            by_slow_share: sag.slow_v / slope_v,
            slow_variance: square(model.slow_share_sigma()),
            noise: noise_variance(sag.at(model.slow_share())) / square(slope_v),
        }
    }

    fn variance(&self) -> f32 {
        let variance = square(self.by_offset) + square(self.by_slow_share) * self.slow_variance + self.noise;
        variance.min(MAX_VARIANCE)
    }
}

/// Whether the curve of the chemistry is flat at half charge.
pub fn has_plateau(model: &CellModel) -> bool {
    let curve = &model.cell.curve;
    let rise_v = curve.voltage_v(0.6) - curve.voltage_v(0.4);
    model.cell.curve_sigma_v > STEEP_SIGMA * rise_v / 0.2
}

fn typical_covariance(model: &CellModel, capacity: &Capacity) -> Matrix {
    let mut covariance = [[0.0; STATES]; STATES];
    covariance[1][1] = square(capacity.sigma);
    covariance[2][2] = 1.0;
    covariance[3][3] = square(model.slow_share_sigma());
    covariance
}

/// Variance of a measured voltage under a sag, in square volts.
fn noise_variance(sag_v: f32) -> f32 {
    let sag_noise_v = SAG_NOISE * sag_v * (1.0 + square(sag_v / LARGE_SAG_V));
    square(NOISE_V) + square(sag_noise_v)
}

fn dot(a: &Vector, b: &Vector) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn square(value: f32) -> f32 {
    value * value
}
