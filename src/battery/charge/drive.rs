//! A drive, from which the pack is learnt when it rests again, and when that rest is evaluated.

use super::cell_model::{Capacity, CellModel, MAX_LEARNT_SIGMA, root_of_squares};
use super::filter::Filter;
use super::load::{Block, HOURS_PER_SECOND, Load, Sum};
use super::start::is_resting;
use crate::battery::learnt::{LearntCapacity, LearntPack, LearntResistance, OFFSET_POINTS, Offset};

/// Charge to be drawn between two rests, in capacities; Texas Instruments' gauges ask for 0.37 (SLUA450).
const MIN_DRAWN: f32 = 0.35;

/// Standard deviation of the charge at the first rest up to which it counts as known.
const MAX_START_SIGMA: f32 = 0.03;

/// Resistance of a drive relative to a typical cell, and to what is kept, up to which the pack was warm.
const WARM_TO_TYPICAL: f32 = 1.5;
const WARM_TO_KEPT: f32 = 1.4;

/// A pack with less than this share of the kept resistance is another one: a pack only ages, and cools.
const OTHER_PACK: f32 = 0.6;

/// What is seen for a shorter time is not learnt, in seconds.
const MIN_DURATION_S: f32 = 60.0;

/// Standard deviation of the true capacity, relative to the rated one.
const RATED_SIGMA: f32 = 0.15;

/// What a capacity may change from drive to drive, relative to it.
const DRIFT_SIGMA: f32 = 0.01;

/// What the offset of a current sensor may count at rest, in capacities per hour: a parked rover teaches little.
const REST_DRIFT_PER_H: f32 = 0.05;

/// A capacity further from the expected one, in standard deviations, is not believed.
const GATE: f32 = 3.0;

/// Standard deviation of the offset seen in one drive, and lower limit of a learnt one, in volts.
const OFFSET_SIGMA_V: f32 = 0.015;
const MIN_OFFSET_SIGMA_V: f32 = 0.008;

/// The kept resistance follows that of this many drives.
const RESISTANCE_DRIVES: f32 = 4.0;

/// A shorter rest teaches nothing, in seconds.
const FIRST_REST_S: f32 = 30.0;

/// What was seen of a pack since its charge was last certain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    start_share: f32,
    start_sigma: f32,
    drawn_ah: f32,
    /// Time at rest, in hours.
    rested_h: f32,
    ohm: Sum,
    parts: [CurvePoint; OFFSET_POINTS],
    /// What was known before, once something was learnt from this drive: each rest is evaluated on its own.
    before: Option<LearntPack>,
}

/// What was seen near one point of the curve.
#[derive(Clone, Copy, Debug)]
struct CurvePoint {
    resting_v: Sum,
    drawn_ah: Sum,
}

impl CurvePoint {
    const NEW: Self = Self {
        resting_v: Sum::NEW,
        drawn_ah: Sum::NEW,
    };
}

impl Drive {
    /// Begins with this estimate.
    pub fn new(start: &Filter) -> Self {
        Self {
            start_share: start.share(),
            start_sigma: start.sigma(),
            drawn_ah: 0.0,
            rested_h: 0.0,
            ohm: Sum::NEW,
            parts: [CurvePoint::NEW; OFFSET_POINTS],
            before: None,
        }
    }

    /// A charge with this standard deviation, in capacities, was drawn unseen.
    pub fn doubt(&mut self, sigma: f32) {
        self.start_sigma = root_of_squares(self.start_sigma, sigma);
    }

    /// A charge was drawn that no measured current shows, in ampere-hours.
    pub fn draw(&mut self, charge_ah: f32) {
        self.drawn_ah += charge_ah;
    }

    /// Takes a block, near this state of charge.
    pub fn add(&mut self, block: &Block, share: f32, model: &CellModel, capacity: &Capacity) {
        let Load {
            duration_s,
            current_a,
            ..
        } = block.load;
        let middle_ah = self.drawn_ah + 0.5 * block.load.drawn_ah();
        self.drawn_ah += block.load.drawn_ah();
        if is_resting(current_a, capacity) {
            self.rested_h += duration_s * HOURS_PER_SECOND;
        }
        let (Some(cell_v), Some(ohm)) = (block.cell_v, model.measured_ohm) else {
            return;
        };
        self.ohm.add(duration_s, ohm);
        let (point, weight) = Offset::position(share);
        let nearest = if weight < 0.5 { point } else { point + 1 };
        if let Some(part) = self.parts.get_mut(nearest) {
            let resting_v = cell_v + block.load.sag_v(ohm, model.cell.slow_share);
            part.resting_v.add(duration_s, resting_v);
            part.drawn_ah.add(duration_s, middle_ah);
        }
    }

    /// Mean resistance of a cell, in ohms. Unlike the latest one it is that of no particular charge.
    pub fn mean_ohm(&self) -> Option<f32> {
        self.ohm.mean(MIN_DURATION_S)
    }

    /// State of charge with this capacity, and its standard deviation.
    pub fn share(&self, capacity: &Capacity) -> (f32, f32) {
        let used = self.drawn_ah / capacity.ah;
        let sigma = root_of_squares(self.start_sigma, used * capacity.sigma);
        (self.start_share - used, sigma)
    }

    /// What is learnt when the pack rests at this voltage of a cell; `None` if that is not more than is known.
    pub fn learn(&mut self, rest: &Load, cell_v: f32, model: &CellModel) -> Option<LearntPack> {
        let rated_ah = model.rated_ah?;
        let ohm = self.mean_ohm()?;
        if self.drawn_ah < MIN_DRAWN * rated_ah || self.start_sigma > MAX_START_SIGMA {
            return None;
        }
        let kept = self.before.unwrap_or(*model.learnt);
        let is_other_pack = kept
            .resistance
            .is_some_and(|kept| ohm < OTHER_PACK * kept.now_ohm);
        let kept = if is_other_pack { LearntPack::UNKNOWN } else { kept };
        if !is_warm(ohm, rated_ah, &kept, model) {
            return None;
        }
        let attempt = |before| Some((before, self.evaluate(ohm, rest, cell_v, &before, model)?));
        // A capacity that contradicts what was learnt is that of another pack.
        let (before, learnt) = attempt(kept).or_else(|| attempt(LearntPack::UNKNOWN))?;
        let is_better = match (self.before, model.learnt.capacity, learnt.capacity) {
            (Some(_), Some(known), Some(new)) => new.sigma < known.sigma,
            _ => true,
        };
        if !is_better {
            return None;
        }
        self.before = Some(before);
        Some(learnt)
    }

    fn evaluate(
        &self,
        ohm: f32,
        rest: &Load,
        cell_v: f32,
        before: &LearntPack,
        model: &CellModel,
    ) -> Option<LearntPack> {
        let rated = Capacity {
            ah: model.rated_ah?,
            sigma: RATED_SIGMA,
        };
        let expected = before.capacity.map_or(rated, |kept| Capacity {
            ah: kept.ah(),
            sigma: kept.sigma + DRIFT_SIGMA,
        });
        let at_rest = CellModel {
            learnt: before,
            measured_ohm: Some(ohm),
            ..*model
        };
        let end = Filter::from_voltage(rest, cell_v, &at_rest, &expected);
        let capacity = self.learn_capacity(&end, &expected)?;
        let mut learnt = LearntPack {
            chemistry: model.chemistry,
            cell_count: model.cell_count?,
            serial_number: model.learnt.serial_number,
            drives: before.drives.saturating_add(1),
            capacity: Some(LearntCapacity::new(capacity.ah, capacity.sigma)),
            resistance: Some(learn_resistance(before.resistance, ohm)),
            ..*before
        };
        if capacity.sigma < MAX_LEARNT_SIGMA {
            self.learn_curve(&mut learnt.offsets, &capacity, model);
        }
        Some(learnt)
    }

    /// A Kalman update of the inverse capacity, by the charge between two rests.
    fn learn_capacity(&self, end: &Filter, expected: &Capacity) -> Option<Capacity> {
        let used = self.start_share - end.share();
        let drawn = self.drawn_ah / expected.ah;
        let innovation = used / drawn - 1.0;
        let rests_sigma = root_of_squares(self.start_sigma, end.sigma());
        let measured_sigma = root_of_squares(rests_sigma, REST_DRIFT_PER_H * self.rested_h) / drawn;
        let variance = expected.sigma * expected.sigma;
        let total = variance + measured_sigma * measured_sigma;
        if innovation * innovation > GATE * GATE * total {
            return None;
        }
        let gain = variance / total;
        Some(Capacity {
            ah: expected.ah / (1.0 + gain * innovation),
            sigma: libm::sqrtf(variance * (1.0 - gain)),
        })
    }

    fn learn_curve(&self, offsets: &mut [Offset; OFFSET_POINTS], capacity: &Capacity, model: &CellModel) {
        for (offset, part) in offsets.iter_mut().zip(&self.parts) {
            let means = part
                .resting_v
                .mean(MIN_DURATION_S)
                .zip(part.drawn_ah.mean(MIN_DURATION_S));
            let Some((resting_v, drawn_ah)) = means else {
                continue;
            };
            let share = self.start_share - drawn_ah / capacity.ah;
            let seen_v = resting_v - model.cell.curve.voltage_v(share);
            let (before_v, sigma_v) = match offset.sigma_v() {
                Some(sigma_v) => (offset.mean_v(), sigma_v),
                None => (0.0, model.cell.curve_sigma_v),
            };
            let variance = sigma_v * sigma_v;
            let gain = variance / (variance + OFFSET_SIGMA_V * OFFSET_SIGMA_V);
            *offset = Offset::from_v(
                before_v + gain * (seen_v - before_v),
                libm::sqrtf(variance * (1.0 - gain)).max(MIN_OFFSET_SIGMA_V),
            );
        }
    }
}

/// Measures a rest. It is evaluated after half a minute, and again whenever it has lasted twice as long.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestTimer {
    rested_s: f32,
    due_s: f32,
}

impl RestTimer {
    pub const fn new() -> Self {
        Self {
            rested_s: 0.0,
            due_s: FIRST_REST_S,
        }
    }

    /// The pack rested for another `dt_s` seconds. Returns whether an evaluation is due.
    pub fn rest(&mut self, dt_s: f32) -> bool {
        self.rested_s += dt_s;
        let is_due = self.rested_s >= self.due_s;
        if is_due {
            self.due_s = 2.0 * self.rested_s;
        }
        is_due
    }
}

fn is_warm(ohm: f32, rated_ah: f32, before: &LearntPack, model: &CellModel) -> bool {
    let typical_ohm = model.cell.ohmic_drop_v / rated_ah;
    let kept = before.resistance;
    ohm <= WARM_TO_TYPICAL * typical_ohm && kept.is_none_or(|kept| ohm <= WARM_TO_KEPT * kept.now_ohm)
}

fn learn_resistance(before: Option<LearntResistance>, ohm: f32) -> LearntResistance {
    match before {
        None => LearntResistance {
            now_ohm: ohm,
            first_ohm: ohm,
        },
        Some(kept) => LearntResistance {
            now_ohm: kept.now_ohm + (ohm - kept.now_ohm) / RESISTANCE_DRIVES,
            ..kept
        },
    }
}
