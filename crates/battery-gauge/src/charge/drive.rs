//! A drive, from which the pack is learnt when it rests again, and when that rest is evaluated.

use super::cell_model::{Capacity, CellModel, KnownCharge, MAX_LEARNT_SIGMA, root_of_squares};
use super::filter::Filter;
use super::lesson::{CurveLesson, SeenPoint, SlowSag, is_warm, learn_capacity, learn_resistance};
use super::load::{Block, HOURS_PER_SECOND, Load, Sum};
use super::start::{Relaxation, is_resting};
use crate::learnt::{LearntPack, LessonObstacle, Lessons, OFFSET_POINTS, Offset, OpenLesson};

/// Charge to be drawn between two rests, in capacities; Texas Instruments' gauges ask for 0.37 (SLUA450).
const MIN_DRAWN: f32 = 0.35;

/// Standard deviation of the charge at the first rest up to which a drive is evaluated: that of any charge by its voltage.
const MAX_START_SIGMA: f32 = 0.08;

/// Resistance of a first drive relative to that of a typical cell, up to which it is that of a cell with its contacts.
const MAX_TO_TYPICAL: f32 = 4.0;

/// Up to here the typical slow sag is that of the cell.
const NEAR_TYPICAL: f32 = 1.5;

/// A point of the curve that is seen for a shorter time is not learnt, in seconds.
const MIN_DURATION_S: f32 = 60.0;

/// Charge that a current sensor's offset may count at rest, in capacities per hour: a long rest teaches little.
const REST_DRIFT_PER_H: f32 = 0.05;

/// A shorter rest teaches nothing, in seconds.
const FIRST_REST_S: f32 = 30.0;

/// The longest interval between evaluations of a rest, in seconds.
const MAX_INTERVAL_S: f32 = 1800.0;

/// A cell whose voltage changes by less, in volts per second, has relaxed (Texas Instruments, SLUA364); over a shorter time
/// than this one, in seconds, so little is not seen.
const RELAXED_V_PER_S: f32 = 4e-6;
const RELAXED_S: f32 = 900.0;

/// By how much less a pack's capacity may be than known, relative to it, if its next start is to end a drive: two standard
/// deviations of a rated one.
const MAX_LESS: f32 = 0.3;

/// A drive that has drawn less, in capacities, begins at the latest rest.
const BEGUN: f32 = 0.05;

/// Observations of a pack since its charge was last certain.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    start: KnownCharge,
    drawn_ah: f32,
    /// Time at rest, in hours.
    rested_h: f32,
    ohm: Sum,
    parts: [CurvePoint; OFFSET_POINTS],
    /// Once something was learnt from it: lessons before this drive, as each rest is evaluated on its own, and the standard
    /// deviation of the capacity that its surest rest has shown, relative to it.
    taught: Option<(Lessons, f32)>,
}

/// A [`SeenPoint`], summed over time.
#[derive(Clone, Copy, Debug)]
struct CurvePoint {
    duration_s: f32,
    sum: SeenPoint,
}

impl CurvePoint {
    const NEW: Self = Self {
        duration_s: 0.0,
        sum: SeenPoint {
            without_fast_v: 0.0,
            slow_v: 0.0,
            drawn_ah: 0.0,
        },
    };

    /// From an [`OpenLesson`] of a drive that has drawn so much, in ampere-hours.
    fn of(point: &[u16; 3], drawn_ah: f32) -> Self {
        let [without_fast, slow, drawn] = point.map(f32::from);
        let mut part = Self::NEW;
        if without_fast > 0.0 {
            let seen = SeenPoint {
                without_fast_v: without_fast * 1e-4,
                slow_v: slow * 1e-4,
                drawn_ah: drawn / f32::from(u16::MAX) * drawn_ah,
            };
            part.add(MIN_DURATION_S, &seen);
        }
        part
    }

    fn as_halves(&self, drawn_ah: f32) -> [u16; 3] {
        self.means().map_or([0; 3], |seen| {
            let drawn = seen.drawn_ah / drawn_ah * f32::from(u16::MAX);
            [seen.without_fast_v * 1e4, seen.slow_v * 1e4, drawn].map(|number| number as u16)
        })
    }

    fn add(&mut self, duration_s: f32, seen: &SeenPoint) {
        self.duration_s += duration_s;
        self.sum.without_fast_v += seen.without_fast_v * duration_s;
        self.sum.slow_v += seen.slow_v * duration_s;
        self.sum.drawn_ah += seen.drawn_ah * duration_s;
    }

    /// The means, if it was seen for long enough.
    fn means(&self) -> Option<SeenPoint> {
        let share = 1.0 / self.duration_s;
        (self.duration_s >= 0.5 * MIN_DURATION_S).then_some(SeenPoint {
            without_fast_v: self.sum.without_fast_v * share,
            slow_v: self.sum.slow_v * share,
            drawn_ah: self.sum.drawn_ah * share,
        })
    }
}

impl Drive {
    /// Begins with this estimate.
    pub fn new(start: &Filter) -> Self {
        Self {
            start: start.charge(),
            drawn_ah: 0.0,
            rested_h: 0.0,
            ohm: Sum::NEW,
            parts: [CurvePoint::NEW; OFFSET_POINTS],
            taught: None,
        }
    }

    /// One that goes on at a start.
    pub fn reopened(lesson: &OpenLesson) -> Self {
        let [soc, sigma] = lesson.start.map(|part| f32::from(part) * 1e-4);
        let mut ohm = Sum::NEW;
        ohm.add(MIN_DURATION_S, lesson.ohm);
        Self {
            start: KnownCharge { soc, sigma },
            drawn_ah: lesson.drawn_ah,
            rested_h: lesson.rested_h,
            ohm,
            parts: lesson.points.map(|point| CurvePoint::of(&point, lesson.drawn_ah)),
            taught: None,
        }
    }

    /// The lesson that a later rest may end.
    pub fn open(&self) -> Option<OpenLesson> {
        Some(OpenLesson {
            start: [self.start.soc, self.start.sigma].map(|part| (part * 1e4) as u16),
            drawn_ah: self.drawn_ah,
            rested_h: self.rested_h,
            ohm: self.mean_ohm()?,
            points: self.parts.each_ref().map(|part| part.as_halves(self.drawn_ah)),
            current_source: 0,
        })
    }

    /// Whether the pack that rests with this estimate may be the one that was driven, and not charged since: not above what is
    /// left by the count, nor, unless a serial number says that it is the same, below it by more than its capacity may be less.
    pub fn may_end_at(&self, rest: &Filter, learnt: &LearntPack, capacity: &Capacity) -> bool {
        let (left, _) = self.soc(capacity);
        let lowest = match learnt.serial_number {
            Some(_) => 0.0,
            None => left - MAX_LESS * (self.start.soc - left),
        };
        (lowest..=left + rest.sigma()).contains(&rest.soc())
    }

    /// A charge with this standard deviation, in capacities, was drawn unseen.
    pub fn inflate(&mut self, sigma: f32) {
        self.start.sigma = root_of_squares(self.start.sigma, sigma);
    }

    /// State of charge at its start.
    pub fn start_soc(&self) -> f32 {
        self.start.soc
    }

    /// The charge at its start is less certain by this share of the capacity.
    pub fn widen(&mut self, share: f32) {
        self.start.sigma += share;
    }

    /// The pack rests with this estimate, at a voltage that alone gives `by_voltage`: a drive that has hardly begun starts from
    /// it, unless start and count are surer than the voltage. Else stops soon after a full start would leave no lesson.
    pub fn rest(&mut self, estimate: &Filter, by_voltage: &Filter, capacity: &Capacity) {
        let (_, counted) = self.soc(capacity);
        let counted = root_of_squares(counted, REST_DRIFT_PER_H * self.rested_h);
        if self.drawn_ah.abs() < BEGUN * capacity.ah && by_voltage.sigma() < counted {
            *self = Self::new(estimate);
        }
    }

    /// Standard deviation, in capacities, of what the offset of a current sensor has counted in this time at rest.
    pub fn rest_drift(rested_s: f32) -> f32 {
        REST_DRIFT_PER_H * HOURS_PER_SECOND * rested_s
    }

    /// A charge was drawn that no measured current shows, in ampere-hours.
    pub fn draw(&mut self, charge_ah: f32) {
        self.drawn_ah += charge_ah;
    }

    /// Takes a block, near this state of charge.
    pub fn add(&mut self, block: &Block, soc: f32, model: &CellModel, capacity: &Capacity) {
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
        let (point, weight) = Offset::position(soc);
        let nearest = if weight < 0.5 { point } else { point + 1 };
        if let Some(part) = self.parts.get_mut(nearest) {
            let seen = SeenPoint {
                without_fast_v: cell_v + ohm * current_a,
                slow_v: ohm * block.load.slow_a,
                drawn_ah: middle_ah,
            };
            part.add(duration_s, &seen);
        }
    }

    /// Mean resistance of a cell, in ohms. Unlike the latest one it is that of no particular charge.
    pub fn mean_ohm(&self) -> Option<f32> {
        self.ohm.mean(MIN_DURATION_S)
    }

    /// Charge drawn, in capacities.
    pub fn used(&self, capacity: &Capacity) -> f32 {
        self.drawn_ah / capacity.ah
    }

    /// State of charge with this capacity, and its standard deviation.
    pub fn soc(&self, capacity: &Capacity) -> (f32, f32) {
        let used = self.used(capacity);
        let sigma = root_of_squares(self.start.sigma, used * capacity.sigma);
        (self.start.soc - used, sigma)
    }

    /// Why nothing can be learnt from it, whatever its rest shows.
    pub fn obstacle(&self, model: &CellModel) -> Option<LessonObstacle> {
        let Some(rated_ah) = model.rated_ah else {
            return Some(LessonObstacle::NoCapacity);
        };
        if self.start.sigma > MAX_START_SIGMA {
            return Some(LessonObstacle::UnknownStart);
        }
        if self.drawn_ah < MIN_DRAWN * rated_ah {
            return Some(LessonObstacle::LittleDrawn);
        }
        let typical_ohm = model.cell.ohmic_drop_v / rated_ah;
        let is_first = self.kept(model).resistance.is_none();
        let is_known = self
            .mean_ohm()
            .is_some_and(|ohm| !is_first || ohm <= MAX_TO_TYPICAL * typical_ohm);
        (!is_known).then_some(LessonObstacle::Resistance)
    }

    /// Whether something was learnt from it.
    pub fn has_taught(&self) -> bool {
        self.taught.is_some()
    }

    /// Knowledge before this drive.
    fn kept(&self, model: &CellModel) -> LearntPack {
        self.taught
            .map_or(*model.learnt, |(before, _)| model.learnt.with_lessons(&before))
    }

    /// Learns the pack when it rests at this voltage of a cell; `None` unless that is the surest rest of the drive.
    pub fn learn(&mut self, rest: &Load, cell_v: f32, model: &CellModel) -> Option<LearntPack> {
        if self.obstacle(model).is_some() {
            return None;
        }
        let ohm = self.mean_ohm()?;
        let kept = self.kept(model);
        let attempt = |before| Some((before, self.evaluate(ohm, rest, cell_v, &before, model)?));
        // A capacity that contradicts what was learnt is that of another pack.
        let (before, (learnt, sigma)) = attempt(kept).or_else(|| attempt(LearntPack::UNKNOWN))?;
        if self.taught.is_some_and(|(_, surest)| surest <= sigma) {
            return None;
        }
        self.taught = Some((before.lessons(), sigma));
        Some(learnt)
    }

    /// Knowledge with this rest, and the standard deviation of the capacity that it shows, relative to that.
    fn evaluate(
        &self,
        ohm: f32,
        rest: &Load,
        cell_v: f32,
        before: &LearntPack,
        model: &CellModel,
    ) -> Option<(LearntPack, f32)> {
        let rated_ah = model.rated_ah?;
        // The offsets of the curve were learnt with the capacity: they say nothing new of it.
        let typical = LearntPack {
            slow: before.slow,
            ..LearntPack::UNKNOWN
        };
        let shown = self.capacity(rest, cell_v, &known(model, &typical, ohm))?;
        let capacity = learn_capacity(before.capacity, &shown, rated_ah)?;
        let mut learnt = LearntPack {
            chemistry: model.chemistry,
            cell_count: model.cell_count?,
            serial_number: model.learnt.serial_number,
            drives: before.drives.saturating_add(1),
            capacity: Some(capacity),
            ..*before
        };
        if is_warm(before.resistance, ohm) {
            learnt.resistance = Some(learn_resistance(before.resistance, ohm));
            if capacity.sigma < MAX_LEARNT_SIGMA {
                let lesson = CurveLesson {
                    start: self.start,
                    capacity: Capacity {
                        ah: capacity.ah(),
                        sigma: capacity.sigma,
                    },
                    slow_sag: if ohm * rated_ah > NEAR_TYPICAL * model.cell.ohmic_drop_v {
                        SlowSag::Learnt
                    } else {
                        SlowSag::Known
                    },
                    model: &known(model, before, ohm),
                };
                self.learn_curve(&lesson, &mut learnt);
            }
        }
        Some((learnt, shown.sigma))
    }

    /// The capacity by the charge between two rests.
    fn capacity(&self, rest: &Load, cell_v: f32, model: &CellModel) -> Option<Capacity> {
        let end = Filter::from_voltage(rest, cell_v, model, &model.capacity()?);
        let used = self.start.soc - end.soc();
        let rests_sigma = root_of_squares(self.start.sigma, end.sigma());
        let sigma = root_of_squares(rests_sigma, REST_DRIFT_PER_H * self.rested_h);
        // Less is nothing that a curve shows.
        (used >= 0.5 * MIN_DRAWN).then(|| Capacity {
            ah: self.drawn_ah / used,
            sigma: sigma / used,
        })
    }

    fn learn_curve(&self, lesson: &CurveLesson, learnt: &mut LearntPack) {
        let points = learnt.offsets.iter().zip(&self.parts);
        learnt.slow = lesson.slow_share(points.filter_map(|(offset, part)| Some((offset, part.means()?))));
        for (offset, part) in learnt.offsets.iter_mut().zip(&self.parts) {
            if let Some(seen) = part.means() {
                *offset = lesson.offset(offset, &seen, learnt.slow);
            }
        }
    }
}

/// A cell with this resistance, of which `learnt` is known.
fn known<'a>(model: &CellModel, learnt: &'a LearntPack, ohm: f32) -> CellModel<'a> {
    CellModel {
        learnt,
        measured_ohm: Some(ohm),
        chemistry: model.chemistry,
        cell: model.cell,
        cell_count: model.cell_count,
        rated_ah: model.rated_ah,
        end: model.end,
        soc_at_most: model.soc_at_most,
        measured: model.measured,
    }
}

/// A rested cell does not rise further by itself, in volts.
const CHARGED_V: f32 = 0.03;

/// Measures a rest. It is evaluated after half a minute, and again whenever it has lasted twice as long, or half an hour more.
#[derive(Clone, Copy, Debug)]
pub struct RestTimer {
    rested_s: f32,
    /// The latest evaluation, in seconds of this rest, and the voltage of a cell then.
    evaluated_s: f32,
    evaluated_v: f32,
}

/// An evaluation of a rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Since the evaluation before, in seconds.
    pub duration_s: f32,
    /// Since its beginning, in seconds.
    pub rested_s: f32,
    pub relaxation: Relaxation,
}

impl RestTimer {
    pub const fn new() -> Self {
        Self {
            rested_s: 0.0,
            evaluated_s: 0.0,
            evaluated_v: 0.0,
        }
    }

    /// Whether this rest was evaluated.
    pub fn is_evaluated(&self) -> bool {
        self.evaluated_s > 0.0
    }

    /// Whether the voltage of a cell has risen so far since it was evaluated that the pack was charged.
    pub fn has_risen(&self, cell_v: f32) -> bool {
        self.is_evaluated() && cell_v > self.evaluated_v + CHARGED_V
    }

    /// The pack rested at this voltage of a cell for another `dt_s` seconds. Returns the evaluation that is due.
    pub fn rest(&mut self, dt_s: f32, cell_v: f32) -> Option<Rest> {
        self.rested_s += dt_s;
        let duration_s = self.rested_s - self.evaluated_s;
        if duration_s < self.evaluated_s.clamp(FIRST_REST_S, MAX_INTERVAL_S) {
            return None;
        }
        let change_v = (cell_v - self.evaluated_v).abs();
        self.evaluated_s = self.rested_s;
        self.evaluated_v = cell_v;
        let is_relaxed = duration_s >= RELAXED_S && change_v <= RELAXED_V_PER_S * duration_s;
        Some(Rest {
            duration_s,
            rested_s: self.rested_s,
            relaxation: if is_relaxed {
                Relaxation::Relaxed
            } else {
                Relaxation::Unknown
            },
        })
    }
}
