//! A pack from power on to power off: readings in, hypotheses and an estimate out.

use super::block::{Block, Lags, Second, SecondSum};
use super::cell::{Cell, Load};
use super::form::{Form, INFERRED, MEASURED};
use super::hypotheses::{Found, Hypotheses, Hypothesis};
use super::inferred_load::InferredLoad;
use super::kept::{Kept, PackShape};
use super::predict::{draw, drift_sag, drift_shape, enlarged, fine_sigma_v, measure_resistance, warm};
use super::states::{CAPACITY, CHARGE, FAST, FINE, Gaussian, RESISTANCE};
use super::update::{Learning, correct};
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

/// All chosen on recordings: noise of a voltage, in volts; and of the sag, while the charge moves; and of the drop by the change of
/// the load since the last block.
const NOISE_V: f64 = 0.004;
const SAG_NOISE: f64 = 0.3;
const STEP_NOISE: f64 = 0.1;

/// All chosen on recordings: the curve's fine error by the sag of a load that is found running; by the sag at 1 C of a load before
/// that was not seen; its slow mean, in capacities per hour, and how long it lasts, in seconds.
const FOUND_SAG: f64 = 0.3;
const UNSEEN_SAG: f64 = 0.4;
const UNSEEN_PER_H: f64 = 0.3;
const UNSEEN_S: f64 = 1000.0;

/// A smoothed surprise in deviations that opens the capacity, by this in a block; its smoothing under load and at rest; all chosen
/// on recordings.
const SURPRISING: f64 = 0.5;
const OPENED_CAPACITY: f64 = 0.04;
const SMOOTHED_LOAD: f64 = 0.05;
const SMOOTHED_REST: f64 = 0.3;

/// Of the warm resistance, from which on a pack is cold, and by how much it is wholly: chosen on recordings.
const COLD_FROM: f64 = 1.2;
const COLD_SPAN: f64 = 0.4;

/// Weight of a block between full and anywhere after the first minute: errors of blocks are alike; chosen on recordings.
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
    form: &'static Form,
    shape: PackShape,
    pub hypotheses: Hypotheses,
    pub loads: Loads,
    inferred: Option<InferredLoad>,
    first: Second,
    second: SecondSum,
    before: Option<Second>,
    lags: Lags,
    block: Block,
    blocks: u32,
    /// The largest load of the first block, in amperes.
    largest_a: f64,
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
    pub fn new(cell: Cell, kept: &Kept, voltage_v: f64, current_a: Option<f64>) -> Self {
        let form = if current_a.is_some() { &MEASURED } else { &INFERRED };
        let new = Kept::new(cell.kind, cell.label_ah);
        // Without a current nothing is learnt, and of what was learnt with one nothing is used.
        let kept = if current_a.is_some() { kept } else { &new };
        let mut gaussian = kept.started();
        if let Some(sigma) = form.resistance_sigma {
            gaussian.set(RESISTANCE, gaussian.mean[RESISTANCE], sigma);
        }
        Self {
            form,
            shape: kept.shape(),
            hypotheses: Hypotheses::new(&gaussian, kept.drives == 0, form),
            loads: Loads::new(kept.collapse),
            inferred: current_a.is_none().then(|| InferredLoad::new(voltage_v)),
            first: Second {
                duration_s: 0.0,
                voltage_v,
                current_a: current_a.unwrap_or(0.0),
            },
            second: SecondSum::default(),
            before: None,
            lags: Lags::default(),
            block: Block::default(),
            blocks: 0,
            largest_a: 0.0,
            is_at_rest: true,
            block_before_a: 0.0,
            last: None,
            cell,
        }
    }

    /// Whether what it learns is kept.
    pub fn teaches(&self) -> bool {
        self.inferred.is_none() && self.blocks > 0
    }

    /// Takes a reading, and the time since the one before; `is_loaded`: the load is on.
    pub fn update(&mut self, dt_s: f64, voltage_v: f64, current_a: Option<f64>, is_loaded: bool) {
        if dt_s > GAP_S {
            self.bridge(dt_s);
            return;
        }
        let current_a = current_a.unwrap_or(0.0);
        let Some(mut second) = self.second.add(dt_s, voltage_v, current_a) else {
            return;
        };
        if let Some(inferred) = &mut self.inferred {
            let load_per_h = inferred.update(&second, self.cell.kind);
            second.current_a = if is_loaded {
                load_per_h * self.cell.label_ah
            } else {
                0.0
            };
        }
        self.largest_a = self.largest_a.max(second.current_a.abs());
        self.lags.add(&second);
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
                self.form.fine_tau_s,
                self.cell.label_ah,
            );
            let sigma = GAP_SIGMA * assumed_ah / self.cell.label_ah;
            gaussian.covariance.add(CHARGE, CHARGE, sigma * sigma);
        }
        if let Some((charge, sigma, _)) = &mut self.last {
            (*charge, *sigma) = self.hypotheses.charge();
        }
        self.second = SecondSum::default();
        self.block = Block::default();
        self.before = None;
    }

    fn take(&mut self, block: &Block) {
        if self.blocks == 0 {
            let rests = self.largest_a < NONE_PER_H * self.cell.label_ah;
            for hypothesis in &mut self.hypotheses.0 {
                hypothesis.has_rested |= rests;
            }
        }
        if self.blocks < REST_BLOCKS && block.current_a.abs() > RESTING_PER_H * self.cell.label_ah {
            self.is_at_rest = false;
        }
        let circumstances = self.circumstances(block);
        let mut hypotheses = std::mem::replace(&mut self.hypotheses, Hypotheses(Vec::new()));
        for hypothesis in &mut hypotheses.0 {
            let log_likelihood = self.step(hypothesis, block, &circumstances);
            hypothesis.log_weight += circumstances.weight * log_likelihood;
        }
        hypotheses.weigh();
        self.hypotheses = hypotheses;
        self.choose();
        let (charge, sigma) = self.hypotheses.charge();
        let best = &self.hypotheses.best().gaussian;
        let slow_a = self.lags.slow_a().max(0.0);
        let usable = self.loads.update(block, best, charge, slow_a, &self.cell);
        self.last = Some((charge, sigma, usable));
        self.block_before_a = block.current_a;
        self.blocks += 1;
    }

    fn circumstances(&self, block: &Block) -> Circumstances {
        let states = &self.hypotheses.best().gaussian.mean;
        let load = Load {
            now_a: block.current_a,
            fast_a: block.continued.fast_a,
            slow_a: block.continued.slow_a,
        };
        let is_tempered = self.blocks >= TEMPERED_BLOCK && self.hypotheses.is_open();
        Circumstances {
            load_a: block.current_a.abs(),
            ohm: self.cell.ohm(states),
            sag_v: self.cell.sag_v(states[CHARGE], states, &load).abs(),
            weight: if is_tempered { TEMPER } else { 1.0 },
        }
    }

    /// Takes a block by one hypothesis; returns its log likelihood.
    fn step(&self, hypothesis: &mut Hypothesis, block: &Block, here: &Circumstances) -> f64 {
        let (voltage_v, load) = self.seen(hypothesis, block);
        let duration_s = block.duration_s;
        let cell = &self.cell;
        self.begin(hypothesis, here);
        let sag_sigma = self.form.sag_sigma * enlarged(here.sag_v);
        let Hypothesis { gaussian, .. } = hypothesis;
        let fine_v = fine_sigma_v(gaussian.mean[CHARGE], here.sag_v, cell);
        let passed_s = if self.blocks > 0 {
            duration_s
        } else {
            f64::INFINITY
        };
        drift_sag(gaussian, passed_s, sag_sigma);
        drift_shape(gaussian, duration_s, &self.shape_at(hypothesis.cold));
        measure_resistance(gaussian, block, self.form.step_noise_v, cell);
        if self.blocks == COLD_BLOCK {
            self.judge_cold(hypothesis);
        }
        let Hypothesis { gaussian, found, .. } = hypothesis;
        warm(gaussian, duration_s);
        // Half of the charge before the measurement, half after it.
        let half_ah = 0.5 * block.current_a * duration_s / 3600.0;
        draw(
            gaussian,
            half_ah,
            0.5 * duration_s,
            fine_v,
            self.form.fine_tau_s,
            cell.label_ah,
        );
        let noise = self.noise(block, here);
        // Below empty nothing is learnt.
        let is_above =
            gaussian.mean[CHARGE] >= 0.0 || voltage_v >= cell.voltage_v(0.0, &gaussian.mean, &load);
        let learning = match (*found, self.inferred) {
            (_, Some(_)) => Learning::ChargeOnly,
            (Found::Full, None) => Learning::All,
            (Found::Anywhere, None) => Learning::NoShape,
        };
        let fit = is_above.then(|| correct(gaussian, voltage_v, &load, noise, learning, cell));
        if let Some(fit) = fit {
            let is_resting = here.load_a <= RESTING_PER_H * cell.label_ah;
            let rate = if is_resting { SMOOTHED_REST } else { SMOOTHED_LOAD };
            hypothesis.surprise += (fit.surprise - hypothesis.surprise) * rate;
        }
        if hypothesis.surprise.abs() > SURPRISING {
            gaussian
                .covariance
                .add(CAPACITY, CAPACITY, OPENED_CAPACITY * OPENED_CAPACITY);
        }
        let offset = self.form.offset_per_h * duration_s / 3600.0;
        gaussian.covariance.add(CHARGE, CHARGE, offset * offset);
        draw(
            gaussian,
            half_ah,
            0.5 * duration_s,
            fine_v,
            self.form.fine_tau_s,
            cell.label_ah,
        );
        gaussian.mean[CHARGE] = gaussian.mean[CHARGE].min(1.01);
        fit.map_or(0.0, |fit| fit.log_likelihood)
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
    fn begin(&self, hypothesis: &mut Hypothesis, here: &Circumstances) {
        let Hypothesis { gaussian, .. } = hypothesis;
        if self.blocks == 0 {
            let by_load_v = FOUND_SAG * here.ohm * here.load_a;
            let sigma_v = self.form.fine_start_v.hypot(by_load_v);
            gaussian.set(FINE, 0.0, sigma_v);
        }
        if self.blocks == UNSEEN_BLOCK && !hypothesis.has_rested {
            let sigma_v = UNSEEN_SAG * here.ohm * self.cell.label_ah;
            gaussian.covariance.add(FINE, FINE, sigma_v * sigma_v);
        }
    }

    fn noise(&self, block: &Block, here: &Circumstances) -> f64 {
        let moving_v = self.form.moving_noise_v.hypot(SAG_NOISE * here.sag_v);
        let moves = (here.load_a / self.cell.label_ah / MOVING_PER_H).min(1.0);
        let step_v = STEP_NOISE * here.ohm * (block.current_a - self.block_before_a).abs();
        NOISE_V * NOISE_V + moving_v * moving_v * moves + step_v * step_v
    }

    fn shape_at(&self, cold: f64) -> [(f64, f64); 3] {
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
            usable: (usable.usable - drawn / span).clamp(0.0, 1.0),
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
