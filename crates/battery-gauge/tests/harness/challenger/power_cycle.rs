//! A pack from power on to power off: readings in, hypotheses and an estimate out.

use super::block::{Block, Lags, Second, SecondSum};
use super::cell::{Cell, Load};
use super::hypotheses::{FULL_SIGMA, Found, Hypotheses, Hypothesis};
use super::kept::{Kept, LastRest, PackShape};
use super::predict::{Shape, draw, drift_sag, drift_shape, fine_sigma_v, measure_resistance, warm};
use super::states::{CAPACITY, CHARGE, FAST, FINE, Gaussian, RESISTANCE};
use super::update::{Fit, Learning, correct};
use super::usable::{Loads, Usable, time_left_s};

/// Readings that are missing for longer are a gap, in seconds.
const GAP_S: f64 = 12.0;
/// The load goes on for so long at most in a gap, in seconds, to this part of it.
const LASTING_S: f64 = 600.0;
const GAP_SIGMA: f64 = 0.5;

/// Loads, in capacities per hour: none; at rest; from which on the charge moves.
const NONE_PER_H: f64 = 0.03;
const RESTING_PER_H: f64 = 0.05;
const MOVING_PER_H: f64 = 0.2;

/// All chosen on recordings: noise of a voltage, in volts; and while the charge moves, since wiggles of the curve must not be matched;
/// of the sag, then; and of the drop by the change of
/// the load since the last block.
const NOISE_V: f64 = 0.004;
const MOVING_NOISE_V: f64 = 0.05;
const SAG_NOISE: f64 = 0.3;
const STEP_NOISE: f64 = 0.1;

/// All chosen on recordings: the curve's fine error at the start, in volts; by the sag of a load that is found running; by the sag at 1 C of a load before
/// that was not seen; its slow mean, in capacities per hour, and how long it lasts, in seconds.
const START_V: f64 = 0.015;
const FOUND_SAG: f64 = 0.3;
const UNSEEN_SAG: f64 = 0.4;
const UNSEEN_PER_H: f64 = 0.3;
const UNSEEN_S: f64 = 1000.0;

/// Smoothing of the surprise under load and at rest: chosen on recordings.
const SMOOTHED_LOAD: f64 = 0.05;
const SMOOTHED_REST: f64 = 0.3;

/// Of the warm resistance, from which on a pack is cold, and by how much it is wholly: chosen on recordings.
const COLD_FROM: f64 = 1.2;
const COLD_SPAN: f64 = 0.4;

/// Weight of a block between hypotheses after the first minute: errors of blocks are alike; chosen on recordings.
const TEMPER: f64 = 0.1;

/// Blocks after which something is judged.
const TEMPERED_BLOCK: u32 = 6;
const UNSEEN_BLOCK: u32 = 5;
const REST_BLOCKS: u32 = 3;
const DECIDED_BLOCK: u32 = 11;
const COLD_BLOCK: u32 = 30;

/// Weights of *full* after two minutes that decide for it, and against it.
const DECIDES: f64 = 0.5;
const REFUTED: f64 = 0.02;

/// A cell that rests within this of its last rest was neither charged nor used, in volts; its charge is known to this then.
const SAME_VOLTAGE_V: f64 = 0.015;
const PAUSE_SIGMA: f64 = 0.03;

/// A current that is reversed: root of the sum of squared steps, in capacities per hour, and share of the typical resistance.
const REVERSED_STEPS_PER_H: f64 = 0.5;
const REVERSED_SHARE: f64 = 0.3;

/// A charge this many deviations of its count off refutes the count: assumed.
const COUNT_REFUTED: f64 = 2.0;

/// A rest shows a full pack from this charge on, less a deviation or this.
const FULL_CHARGE: f64 = 0.95;
const FULL_MARGIN: f64 = 0.02;

/// An estimate after a block, and what was drawn since.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub charge: f64,
    pub sigma: f64,
    /// From 0 to 1.
    pub usable: f64,
    pub usable_sigma: f64,
    pub time_left_s: Option<f64>,
}

#[derive(Clone, Debug)]
pub struct PowerCycle {
    cell: Cell,
    shape: PackShape,
    /// The last rest, if no load followed.
    pub last_rest: Option<LastRest>,
    /// Sums of the squared steps of the current, and of the steps times the voltage's, in A² and V·A.
    steps: f64,
    steps_v: f64,
    is_as_left: bool,
    /// Capacity of the count, in ampere-hours, and the deviation of its logarithm.
    counted_by: (f64, f64),
    pub hypotheses: Hypotheses,
    pub loads: Loads,
    first: Second,
    second: SecondSum,
    before: Option<Second>,
    lags: Lags,
    block: Block,
    /// The largest smoothed difference from what was expected, in deviations.
    pub worst_surprise: f64,
    blocks: u32,
    /// The largest load of the first block, in amperes.
    largest_a: f64,
    /// Charge drawn so far, in ampere-hours.
    pub drawn_ah: f64,
    is_at_rest: bool,
    /// Mean load of the last block, in amperes.
    block_before_a: f64,
    last: Option<(f64, f64, Usable)>,
}

/// Common to all hypotheses in a block.
struct Circumstances {
    load_a: f64,
    /// Resistance and sag of the likeliest, so that none gains by stating less noise.
    ohm: f64,
    sag_v: f64,
    weight: f64,
}

impl PowerCycle {
    /// With its first reading.
    pub fn new(cell: Cell, kept: &Kept, voltage_v: f64, current_a: f64) -> Self {
        let is_same = |last: &LastRest| (voltage_v - last.voltage_v).abs() <= SAME_VOLTAGE_V;
        let as_left = kept
            .last
            .filter(is_same)
            .map(|last| (last.charge, last.sigma.hypot(PAUSE_SIGMA)));
        let hypotheses = Hypotheses::new(&kept.started(), kept.drives == 0, as_left);
        let first = &hypotheses.0[0].gaussian;
        Self {
            shape: kept.shape(),
            last_rest: kept.last,
            steps: 0.0,
            steps_v: 0.0,
            is_as_left: as_left.is_some(),
            counted_by: (cell.label_ah * first.mean[CAPACITY].exp(), first.sigma(CAPACITY)),
            hypotheses,
            loads: Loads::new(kept.collapse),
            first: Second {
                duration_s: 0.0,
                voltage_v,
                current_a,
            },
            second: SecondSum::default(),
            before: None,
            lags: Lags::default(),
            block: Block::default(),
            worst_surprise: 0.0,
            blocks: 0,
            largest_a: 0.0,
            drawn_ah: 0.0,
            is_at_rest: true,
            block_before_a: 0.0,
            last: None,
            cell,
        }
    }

    /// Whether what it learns is kept.
    pub fn teaches(&self) -> bool {
        self.blocks > 0 && self.is_plausible()
    }

    /// Whether the current has the sign that the voltage shows.
    pub fn is_plausible(&self) -> bool {
        let is_enough = self.steps > (REVERSED_STEPS_PER_H * self.cell.label_ah).powi(2);
        !(is_enough && self.steps_v < -REVERSED_SHARE * self.cell.typical_ohm * self.steps)
    }

    /// Takes a reading, and the time since the one before.
    pub fn update(&mut self, dt_s: f64, voltage_v: f64, current_a: f64) {
        if dt_s > GAP_S {
            self.bridge(dt_s);
            return;
        }
        let Some(second) = self.second.add(dt_s, voltage_v, current_a) else {
            return;
        };
        self.largest_a = self.largest_a.max(second.current_a.abs());
        self.lags.add(&second);
        self.loads.see_end(second, &self.cell);
        let before = self.before.replace(second);
        if let Some(block) = self.block.add(&second, before.as_ref(), &self.lags) {
            self.take(&block);
        }
    }

    /// Readings are missing: the load may have lasted.
    fn bridge(&mut self, dt_s: f64) {
        let load_a = self.block_before_a;
        let assumed_ah = load_a * dt_s.min(LASTING_S) / 3600.0;
        let partial_ah = (self.second.ampere_s() + self.block.ampere_s()) / 3600.0;
        let lasting = Second {
            duration_s: dt_s,
            voltage_v: 0.0,
            current_a: if dt_s > LASTING_S { 0.0 } else { load_a },
        };
        self.lags.add(&lasting);
        for Hypothesis { gaussian, .. } in &mut self.hypotheses.0 {
            let fine_v = fine_sigma_v(gaussian.mean[CHARGE], 0.0, &self.cell);
            draw(
                gaussian,
                partial_ah + assumed_ah,
                dt_s,
                fine_v,
                self.cell.label_ah,
            );
            let sigma = GAP_SIGMA * assumed_ah / self.cell.label_ah;
            gaussian.covariance.add(CHARGE, CHARGE, sigma * sigma);
        }
        self.drawn_ah += partial_ah + assumed_ah;
        if let Some((charge, sigma, _)) = &mut self.last {
            (*charge, *sigma) = self.hypotheses.charge();
        }
        self.second = SecondSum::default();
        self.block = Block::default();
        self.before = None;
    }

    fn take(&mut self, block: &Block) {
        self.see_rest(block);
        self.steps += block.steps;
        self.steps_v += block.steps_v;
        let circumstances = self.circumstances(block);
        let mut hypotheses = std::mem::replace(&mut self.hypotheses, Hypotheses(Vec::new()));
        for hypothesis in &mut hypotheses.0 {
            let log_likelihood = self.step(hypothesis, block, &circumstances);
            hypothesis.log_weight += circumstances.weight * log_likelihood;
        }
        hypotheses.weigh();
        self.hypotheses = hypotheses;
        self.worst_surprise = self.worst_surprise.max(self.hypotheses.best().surprise.abs());
        self.choose();
        self.drawn_ah += block.current_a * block.duration_s / 3600.0;
        let (charge, sigma) = self.hypotheses.charge();
        let charge = self.with_count(charge, sigma);
        let best = &self.hypotheses.best().gaussian;
        let slow_a = self.lags.slow_a().max(0.0);
        let usable = self.loads.update(block, best, charge, slow_a, &self.cell);
        self.last = Some((charge, sigma, usable));
        self.last_rest = self.is_resting(block).then_some(LastRest {
            voltage_v: block.voltage_v,
            charge,
            sigma,
        });
        self.block_before_a = block.current_a;
        self.blocks += 1;
    }

    fn is_resting(&self, block: &Block) -> bool {
        block.current_a.abs() <= RESTING_PER_H * self.cell.label_ah
    }

    /// Whether it begins at rest.
    fn see_rest(&mut self, block: &Block) {
        if self.blocks == 0 {
            let rests = self.largest_a < NONE_PER_H * self.cell.label_ah;
            for hypothesis in &mut self.hypotheses.0 {
                hypothesis.has_rested |= rests;
            }
        }
        self.is_at_rest &= self.blocks >= REST_BLOCKS || self.is_resting(block);
    }

    /// The charge of a certain start, weighed with its count by their deviations unless the count is refuted: voltages that the
    /// model does not explain move it less.
    fn with_count(&self, charge: f64, sigma: f64) -> f64 {
        if self.hypotheses.is_open() || self.hypotheses.best().found != Found::Full {
            return charge;
        }
        let (capacity_ah, capacity_sigma) = self.counted_by;
        let drawn = self.drawn_ah / capacity_ah;
        let count_sigma = FULL_SIGMA.hypot(capacity_sigma * drawn);
        let off = 1.0 - drawn - charge;
        let weight = sigma * sigma / (sigma * sigma + count_sigma * count_sigma);
        charge + off * weight / (1.0 + (off / (COUNT_REFUTED * count_sigma)).powi(4))
    }

    fn circumstances(&self, block: &Block) -> Circumstances {
        let states = &self.hypotheses.best().gaussian.mean;
        let load = Load {
            now_a: block.current_a,
            fast_a: block.continued.fast_a,
            slow_a: block.continued.slow_a,
        };
        Circumstances {
            load_a: block.current_a.abs(),
            ohm: self.cell.ohm(states),
            sag_v: self.cell.sag_v(states[CHARGE], states, &load).abs(),
            weight: if self.blocks < TEMPERED_BLOCK { 1.0 } else { TEMPER },
        }
    }

    /// Takes a block by one hypothesis; returns its log likelihood.
    fn step(&self, hypothesis: &mut Hypothesis, block: &Block, here: &Circumstances) -> f64 {
        let (voltage_v, load) = self.seen(hypothesis, block);
        let fine_v = self.drift(hypothesis, block, here, load.now_a);
        // Half of the charge before the measurement, half after it.
        let half_ah = 0.5 * block.current_a * block.duration_s / 3600.0;
        let draw_half = |gaussian: &mut Gaussian| {
            draw(
                gaussian,
                half_ah,
                0.5 * block.duration_s,
                fine_v,
                self.cell.label_ah,
            );
        };
        draw_half(&mut hypothesis.gaussian);
        let fit = self.measure(hypothesis, voltage_v, &load, self.noise(block, here));
        if let Some(fit) = fit {
            let rate = if self.is_resting(block) {
                SMOOTHED_REST
            } else {
                SMOOTHED_LOAD
            };
            hypothesis.surprise += (fit.surprise - hypothesis.surprise) * rate;
        }
        draw_half(&mut hypothesis.gaussian);
        hypothesis.gaussian.covariance.keep_apart();
        let charge = &mut hypothesis.gaussian.mean[CHARGE];
        *charge = charge.min(1.01);
        fit.map_or(0.0, |fit| fit.log_likelihood)
    }

    /// Lets errors, the shape of the sag and the resistance change; returns the deviation of the curve's fine error, in volts.
    fn drift(&self, hypothesis: &mut Hypothesis, block: &Block, here: &Circumstances, load_a: f64) -> f64 {
        let (duration_s, cell) = (block.duration_s, &self.cell);
        self.begin(hypothesis, here, load_a);
        let shape = self.shape_at(hypothesis.cold);
        let gaussian = &mut hypothesis.gaussian;
        let fine_v = fine_sigma_v(gaussian.mean[CHARGE], here.sag_v, cell);
        let passed_s = if self.blocks > 0 {
            duration_s
        } else {
            f64::INFINITY
        };
        drift_sag(gaussian, passed_s, here.sag_v);
        drift_shape(gaussian, duration_s, &shape);
        measure_resistance(gaussian, block, cell);
        if self.blocks == COLD_BLOCK {
            self.judge_cold(hypothesis);
        }
        warm(&mut hypothesis.gaussian, duration_s);
        fine_v
    }

    /// Corrects by the voltage; below empty nothing is learnt.
    fn measure(&self, hypothesis: &mut Hypothesis, voltage_v: f64, load: &Load, noise: f64) -> Option<Fit> {
        let Hypothesis { gaussian, found, .. } = hypothesis;
        let is_above =
            gaussian.mean[CHARGE] >= 0.0 || voltage_v >= self.cell.voltage_v(0.0, &gaussian.mean, load);
        let learning = match found {
            Found::Full => Learning::All,
            Found::AsLeft | Found::Anywhere => Learning::NoShape,
        };
        is_above.then(|| correct(gaussian, voltage_v, load, noise, learning, &self.cell))
    }

    /// Voltage and load of a block, as this hypothesis takes them.
    fn seen(&self, hypothesis: &Hypothesis, block: &Block) -> (f64, Load) {
        if self.blocks == 0 && hypothesis.found == Found::Full {
            // Of a load that begins only the immediate part is in the very first voltage.
            let load = Load {
                now_a: self.first.current_a,
                fast_a: 0.0,
                slow_a: 0.0,
            };
            return (self.first.voltage_v, load);
        }
        let lagged = if hypothesis.has_rested {
            block.rested
        } else {
            block.continued
        };
        let mut slow_a = lagged.slow_a;
        if !hypothesis.has_rested {
            let unseen = (-self.lags.age_s() / UNSEEN_S).exp();
            let mixed_a =
                (1.0 - unseen) * block.continued.slow_a + unseen * UNSEEN_PER_H * self.cell.label_ah;
            slow_a = slow_a.max(mixed_a);
        }
        let load = Load {
            now_a: block.current_a,
            fast_a: lagged.fast_a,
            slow_a,
        };
        (block.voltage_v, load)
    }

    /// Doubts of the very first blocks.
    fn begin(&self, hypothesis: &mut Hypothesis, here: &Circumstances, load_a: f64) {
        let Hypothesis { gaussian, .. } = hypothesis;
        if self.blocks == 0 {
            let by_load_v = FOUND_SAG * here.ohm * load_a;
            let sigma_v = START_V.hypot(by_load_v);
            gaussian.set(FINE, 0.0, sigma_v);
        }
        if self.blocks == UNSEEN_BLOCK && !hypothesis.has_rested {
            let sigma_v = UNSEEN_SAG * here.ohm * self.cell.label_ah;
            gaussian.covariance.add(FINE, FINE, sigma_v * sigma_v);
        }
    }

    fn noise(&self, block: &Block, here: &Circumstances) -> f64 {
        let moving_v = MOVING_NOISE_V.hypot(SAG_NOISE * here.sag_v);
        let moves = (here.load_a / self.cell.label_ah / MOVING_PER_H).min(1.0);
        let step_v = STEP_NOISE * here.ohm * (block.current_a - self.block_before_a).abs();
        NOISE_V * NOISE_V + moving_v * moving_v * moves + step_v * step_v
    }

    fn shape_at(&self, cold: f64) -> Shape {
        std::array::from_fn(|number| {
            let ((own, sigma), (usual, _)) = (self.shape.own[number], self.shape.usual[number]);
            (own + cold * (usual - own), sigma)
        })
    }

    /// In the cold, the shape of the sag that was learnt in warm drives is not this one's.
    fn judge_cold(&self, hypothesis: &mut Hypothesis) {
        let Some(warm) = self.shape.warm else { return };
        let Hypothesis { gaussian, cold, .. } = hypothesis;
        let ratio = gaussian.mean[RESISTANCE].exp() / warm;
        *cold = ((ratio - COLD_FROM) / COLD_SPAN).clamp(0.0, 1.0);
        for (number, (mean, sigma)) in self.shape.usual.iter().enumerate() {
            gaussian.revert(FAST + number, 1.0 - *cold, *mean, *sigma);
        }
    }

    /// Decides between full and anywhere: by the first voltage at rest, by a rest of half a minute, or by weight after two minutes.
    fn choose(&mut self) {
        if !self.hypotheses.is_open() {
            return;
        }
        let full = self.hypotheses.weight_of(Found::Full);
        let decision = match self.blocks {
            0 if self.is_at_rest && self.is_as_left => Some(Found::AsLeft),
            0 if self.is_as_left => {
                self.hypotheses.drop(Found::AsLeft);
                None
            }
            0 if self.is_at_rest && self.first.voltage_v > self.cell.full_v() => Some(Found::Full),
            blocks if blocks == REST_BLOCKS - 1 && self.is_at_rest && self.may_be_full() => Some(Found::Full),
            DECIDED_BLOCK if full > DECIDES => Some(Found::Full),
            DECIDED_BLOCK if full < REFUTED => Some(Found::Anywhere),
            _ => None,
        };
        if let Some(found) = decision {
            self.hypotheses.decide(found);
        }
    }

    /// Whether a hypothesis that could be anywhere is near full.
    fn may_be_full(&self) -> bool {
        self.hypotheses.0.iter().any(|hypothesis| {
            let Gaussian { mean, .. } = &hypothesis.gaussian;
            let margin = hypothesis.gaussian.sigma(CHARGE).min(FULL_MARGIN);
            hypothesis.found == Found::Anywhere && mean[CHARGE] > FULL_CHARGE - margin
        })
    }

    /// The estimate now: after the last block, less what was drawn since.
    pub fn estimate(&self) -> Option<Estimate> {
        let (charge, sigma, usable) = self.last?;
        let best = &self.hypotheses.best().gaussian;
        let capacity_ah = self.cell.label_ah * best.mean[CAPACITY].exp();
        let drawn = (self.second.ampere_s() + self.block.ampere_s()) / 3600.0 / capacity_ah;
        let charge = charge - drawn;
        let span = (1.0 - usable.end).max(0.02);
        let time_left_s = usable
            .mean_a
            .map(|mean_a| time_left_s(charge - usable.end, best, mean_a, self.cell.label_ah));
        Some(Estimate {
            charge: charge.clamp(0.0, 1.0),
            sigma,
            usable: if self.loads.has_ended {
                0.0
            } else {
                (usable.usable - drawn / span).clamp(0.0, 1.0)
            },
            usable_sigma: usable.sigma,
            time_left_s,
        })
    }

    /// The owner sets the charge, to a deviation.
    pub fn set_charge(&mut self, charge: f64, sigma: f64) {
        self.hypotheses.decide(self.hypotheses.best().found);
        for hypothesis in &mut self.hypotheses.0 {
            hypothesis.gaussian.set(CHARGE, charge, sigma);
        }
        if let Some((last, last_sigma, _)) = &mut self.last {
            (*last, *last_sigma) = (charge, sigma);
        }
    }
}
