//! State of charge: counted where the current is measured, corrected by the voltage; learnt from drive to drive.
//!
//! Sums are kept at every reading; everything else runs once a second, and the comparison with the model once in ten.

mod cell_model;
mod counting;
mod drive;
mod filter;
mod lesson;
mod load;
mod reference;
mod start;
mod voltage_only;

pub use cell_model::{Capacity, CellModel, EndVoltage, KnownCharge, measured_height_v, measured_offsets};
pub use load::{CurrentOrigin, Quantity, SILENCE_S, Second};
pub use reference::{PackIdentity, Reference};

use crate::learnt::{LastCharge, LessonObstacle, OpenLesson};
use crate::swap::Doubt;
use crate::{CurrentRange, LearntPack, LoadState};
use cell_model::root_of_squares;
use counting::Counting;
use drive::{Drive, Rest, RestTimer};
use filter::{Filter, STEEP_SIGMA};
use load::{Gathering, HOURS_PER_SECOND, Load, Polarisation, Trace, Unread};
use start::{Start, is_flat, is_idle, is_resting, was_charged};
use voltage_only::VoltageOnly;

/// After a longer time without a reading, in seconds, the load meanwhile is taken for that of the time before: one
/// reading does not represent that much time.
const GAP_S: f32 = 15.0;

/// After a longer gap the estimate restarts, in seconds.
const MAX_GAP_S: f32 = 600.0;

/// Standard deviation of a load in a gap, in capacities per hour.
const GAP_RATE_PER_H: f32 = 1.0;

/// Rise of the usable charge while driving, at most, per second: less than 3 points in ten minutes.
const MAX_RISE_PER_S: f32 = 0.029 / 600.0;

/// Estimates the charge of one pack, and learns the pack.
#[derive(Clone, Copy, Debug)]
pub struct ChargeEstimator {
    gathering: Gathering,
    phase: Phase,
    trace: Trace,
    rest: RestTimer,
    load_state: LoadState,
    doubt: Doubt,
    /// The pack as it was counted last while nothing was in doubt.
    reference: Option<Reference>,
    estimate: Option<ChargeEstimate>,
}

/// Method of the estimate.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Not yet.
    Starting(Start),
    /// From a state of charge that is known.
    Known(KnownCharge),
    /// By the current.
    Counting(Counting),
    /// By the voltage alone.
    VoltageOnly(VoltageOnly),
}

/// A reading of a pack.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Since the reading before, in seconds.
    pub dt_s: f32,
    /// In volts.
    pub voltage_v: Option<f32>,
    /// Mean since the reading before, in amperes.
    pub current_a: Option<f32>,
    pub origin: CurrentOrigin,
    pub range: CurrentRange,
    /// Charge that the source has counted beyond this current, in ampere-hours.
    pub unmeasured_ah: f32,
    /// Time without readings that were due, in seconds.
    pub missed_s: f32,
}

/// The estimate of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChargeEstimate {
    /// State of charge, from 0 to 1.
    pub soc: f32,
    /// Its standard deviation.
    pub sigma: f32,
    /// Usable charge: how much such a load can still draw, relative to the capacity, from 0 to 1.
    pub available: f32,
    /// Usable charge, relative to what such a load can draw from a full pack, from 0 to 1.
    pub usable_soc: f32,
    /// Its standard deviation.
    pub usable_sigma: f32,
    /// Charge drawn, in capacities per hour, where the current is not measured.
    pub rate_per_h: Option<f32>,
    /// The state of charge, whatever the source's count leaves.
    pub by_itself: KnownCharge,
    /// Whether the pack rests.
    pub rests: bool,
}

impl ChargeEstimate {
    /// While driving, what is usable rises slowly: a load that falls for a while may come again.
    fn limit_rise(&mut self, before: &Self, duration_s: f32) {
        let rise = MAX_RISE_PER_S * duration_s;
        let limited = self.usable_soc.min(before.usable_soc + rise);
        if limited < self.usable_soc {
            self.available *= limited / self.usable_soc;
            self.usable_soc = limited;
        }
    }
}

impl ChargeEstimator {
    pub const fn new() -> Self {
        Self::in_phase(Phase::Starting(Start::NEW))
    }

    /// Delays the end of the first second, and with it all that follow.
    pub fn delay(&mut self, delay_s: f32) {
        self.gathering.delay(delay_s);
    }

    /// Continues with a known charge.
    pub const fn from_known(charge: KnownCharge) -> Self {
        let mut known = Self::in_phase(Phase::Known(charge));
        known.estimate = Some(ChargeEstimate {
            soc: charge.soc,
            sigma: charge.sigma,
            available: charge.soc,
            usable_soc: charge.soc,
            usable_sigma: charge.sigma,
            rate_per_h: None,
            by_itself: charge,
            rests: false,
        });
        known
    }

    /// The known charge was retained over a restart.
    pub fn restore(&mut self, reference: Reference, doubt: Doubt) {
        self.doubt = doubt;
        self.reference = Some(reference);
        self.trace.polarisation = Polarisation::steady(reference.slow_a);
        if self.is_of_pack_before() {
            // Until its voltage says how certain that is.
            self.estimate = None;
        }
    }

    const fn in_phase(phase: Phase) -> Self {
        Self {
            gathering: Gathering::NEW,
            phase,
            trace: Trace::NEW,
            rest: RestTimer::new(),
            load_state: LoadState::Off,
            doubt: Doubt::None,
            reference: None,
            estimate: None,
        }
    }

    /// The latest estimate, if there is one.
    pub fn estimate(&self) -> Option<&ChargeEstimate> {
        self.estimate.as_ref()
    }

    /// Whether the charge was counted of a pack that may not be this one.
    fn is_of_pack_before(&self) -> bool {
        self.doubt == Doubt::ContactLoss && self.reference.is_some()
    }

    /// The charge to retain over a reset: as it was counted, if that may not be this pack's.
    pub fn known(&self) -> Option<KnownCharge> {
        if let Phase::Known(charge) = self.phase {
            return Some(charge);
        }
        let estimate = self.estimate?;
        Some(KnownCharge {
            soc: estimate.soc,
            sigma: estimate.sigma.min(estimate.by_itself.sigma),
        })
    }

    /// The pack as it was counted last while nothing was in doubt.
    pub fn reference(&self) -> Option<Reference> {
        self.reference
    }

    /// The owner says that this is another pack. Under load, counting goes on: a start there is worse.
    pub fn change_pack(&mut self) {
        match self.load_state {
            LoadState::Off => *self = Self::new(),
            LoadState::On => self.restart_drive(),
        }
    }

    /// A pack rests at this voltage of a cell and current after its contact was lost. If it is not the one whose current was
    /// counted, or was charged meanwhile, the estimate restarts; else it is as uncertain as the voltage leaves it.
    pub fn compare(&mut self, cell_v: f32, current_a: f32, model: &CellModel) -> PackIdentity {
        let (Some(before), Some(estimate)) = (&self.reference, &self.estimate) else {
            return PackIdentity::Same;
        };
        let load = Load {
            current_a,
            slow_a: self.trace.polarisation.current_a(),
            ..Load::NONE
        };
        let now = Reference::new(estimate.by_itself.soc, cell_v, &load, model);
        let (identity, contradiction) = before.compare(&now, model);
        if identity != PackIdentity::Same {
            *self = Self::new();
        } else if let Phase::Counting(counting) = &mut self.phase {
            counting.inflate(contradiction);
        }
        identity
    }

    /// Whether a pack whose charge was retained over a restart can't be the one that was counted, as its voltage in this
    /// second is above all at which that one can rest, and no charger raises it.
    pub fn is_exceeded_by(&self, second: &Second, doubt: Doubt, model: &CellModel) -> bool {
        let before = self.reference.filter(|before| before.is_retained);
        let (Some(before), Some(voltage_v), Some(count)) = (before, second.voltage_v, model.cell_count)
        else {
            return false;
        };
        let is_charging = second.current_a.is_some_and(|current_a| current_a < 0.0);
        doubt == Doubt::ContactLoss && !is_charging && voltage_v > f32::from(count) * before.highest_v(model)
    }

    /// A pack rests at this voltage of a cell after the scale of its voltage was changed: an estimate that was based on the
    /// old one restarts. On a flat curve a count is better, but it may have started from a wrong voltage.
    pub fn rescale(&mut self, cell_v: f32, current_a: f32, model: &CellModel) -> PackIdentity {
        match (&mut self.phase, model.capacity()) {
            (Phase::Starting(_) | Phase::Known(_), _) => return PackIdentity::Same,
            (Phase::Counting(counting), Some(capacity)) => {
                let load = Load {
                    current_a,
                    slow_a: self.trace.polarisation.current_a(),
                    ..Load::NONE
                };
                let counted_v = model.voltage_v(counting.filter.soc());
                let is_flat_at =
                    |load: &Load, cell_v: f32| is_flat(&Filter::from_voltage(load, cell_v, model, &capacity));
                if is_flat_at(&load, cell_v) || is_flat_at(&Load::NONE, counted_v) {
                    counting.inflate(STEEP_SIGMA);
                    return PackIdentity::Same;
                }
            }
            _ => {}
        }
        *self = Self::new();
        PackIdentity::OtherCharge
    }

    /// Discards the observations so far: they must not be learnt.
    pub fn restart_drive(&mut self) {
        if let Phase::Counting(counting) = &mut self.phase {
            counting.restart_drive();
        }
    }

    /// The current is lost: the estimate goes on by the voltage.
    pub fn lose_current(&mut self, model: &CellModel) {
        if let Phase::Counting(counting) = &self.phase {
            self.phase = Phase::VoltageOnly(counting.by_voltage(&self.trace, model));
            self.trace.polarisation = Polarisation::at_rest();
        }
    }

    /// The current is made of another source: what was counted must not be learnt, nor do earlier loads show the rest of a sag.
    pub fn change_current(&mut self) {
        if let Phase::Counting(counting) = &mut self.phase {
            counting.change_current();
        }
        self.trace.polarisation = Polarisation::unknown();
    }

    /// Takes a reading. Returns the means of a second that it completes.
    pub fn add(&mut self, sample: &Sample) -> Option<Second> {
        let Sample {
            dt_s,
            mut voltage_v,
            mut current_a,
            ..
        } = *sample;
        if dt_s > MAX_GAP_S {
            *self = Self::new();
        }
        if let Phase::Starting(start) = &mut self.phase {
            start.add(dt_s, voltage_v, current_a);
        }
        if dt_s > GAP_S
            && let Phase::Counting(counting) = &mut self.phase
        {
            counting.inflate(GAP_RATE_PER_H * HOURS_PER_SECOND * dt_s);
            if let Some(before_a) = self.trace.polarisation.mean_a() {
                voltage_v = None;
                current_a = current_a.or(Some(before_a));
            }
        }
        if sample.range == CurrentRange::Over {
            // The sag of the load is not known either.
            voltage_v = None;
        }
        let charge_ah = |duration_s: f32| current_a.unwrap_or(0.0).abs() * duration_s * HOURS_PER_SECOND;
        self.gathering.add_unread(&Unread {
            unmeasured_ah: sample.unmeasured_ah,
            assumed_ah: charge_ah(sample.missed_s),
            over_range_ah: match sample.range {
                CurrentRange::Over => charge_ah(dt_s),
                CurrentRange::Within | CurrentRange::OverAndCounted => 0.0,
            },
        });
        self.gathering.add(dt_s, voltage_v, current_a, sample.origin)
    }

    /// Takes a second. Returns the record to keep of the pack, if this second changes it.
    ///
    /// Each step reads what those before it have left: the charge is drawn, the rest is timed, what a rest shows is learnt, and
    /// the estimate is made of all that.
    pub fn update(
        &mut self,
        second: &Second,
        load_state: LoadState,
        doubt: Doubt,
        model: &CellModel,
    ) -> Option<LearntPack> {
        let count = f32::from(model.cell_count?);
        let cell_v = second.voltage_v.map(|voltage_v| voltage_v / count);
        let capacity = model.capacity();
        let was_loaded = core::mem::replace(&mut self.load_state, load_state) == LoadState::On;
        let was_starting = matches!(self.phase, Phase::Starting(_));
        let was_settled = self.phase.is_settled();
        self.doubt = doubt;
        if let Some(capacity) = &capacity {
            self.draw_unread(&second.unread, capacity);
        }
        let (load, rests) = self.follow_load(second, cell_v, capacity.as_ref(), model);
        // A source that only counts shows a charger by the voltage.
        let is_charged = second.origin == CurrentOrigin::SourceCounter
            && cell_v.is_some_and(|cell_v| self.rest.has_risen(cell_v));
        if !rests || is_charged {
            self.rest = RestTimer::new();
        }
        let mut kept = None;
        if let Some(cell_v) = cell_v
            && !self.is_of_pack_before()
            && doubt != Doubt::Rescaled
        {
            let has_open_lesson = model.learnt.open.is_some();
            let rest = if rests {
                self.rest.rest(load.duration_s, cell_v)
            } else {
                None
            };
            if let Some(rest) = rest {
                // The pack has rested for long enough: the drive may have taught something.
                let learnt = self.evaluate(&rest, &load, cell_v, second.origin, model);
                kept = self.record(&load, cell_v, learnt, model);
            } else if was_loaded && load_state == LoadState::Off {
                // It may be taken out before it has rested.
                kept = self.record(&load, cell_v, None, model);
            } else if has_open_lesson && load_state == LoadState::On {
                // It has not rested between the drives.
                kept = Some(model.learnt.without_open_lesson());
            } else if has_open_lesson && was_starting && rests {
                // This start is the rest behind the drive before.
                kept = self.end_lesson(&load, cell_v, model);
            }
        }
        let before = self.estimate;
        let learnt = kept.as_ref().unwrap_or(model.learnt);
        self.estimate = self.estimate_now(CellModel { learnt, ..*model }, rests);
        let brakes = capacity.is_some_and(|capacity| was_charged(&load, &capacity));
        if load_state == LoadState::On
            && was_settled
            && !brakes
            && let (Some(estimate), Some(before)) = (&mut self.estimate, before)
        {
            estimate.limit_rise(&before, second.duration_s);
        }
        self.update_reference(&load, second, cell_v, model);
        kept
    }

    /// Draws the charge of a second that no measured current shows.
    fn draw_unread(&mut self, unread: &Unread, capacity: &Capacity) {
        self.phase.draw(unread.unmeasured_ah, capacity);
        if let Phase::Counting(counting) = &mut self.phase {
            counting.assume(unread.assumed_ah, capacity);
            if unread.over_range_ah > 0.0 {
                counting.exceed_range(unread.over_range_ah, capacity);
            }
        }
    }

    /// Counts the load of a second, or infers it from the voltage of a cell. Returns it, and whether the pack rests.
    fn follow_load(
        &mut self,
        second: &Second,
        cell_v: Option<f32>,
        capacity: Option<&Capacity>,
        model: &CellModel,
    ) -> (Load, bool) {
        // A count that may be another pack's is not corrected by this one's voltage: the rest has to deny it.
        let is_retained = self.reference.is_some_and(|before| before.is_retained);
        let credible_v = cell_v.filter(|_| !is_retained || !self.is_of_pack_before());
        let is_off = self.load_state == LoadState::Off;
        let trace = &mut self.trace;
        if let (Some(current_a), Some(capacity)) = (second.current_a, capacity) {
            trace.polarisation.update(second.duration_s, current_a);
            let load = Load {
                duration_s: second.duration_s,
                current_a,
                slow_a: trace.polarisation.current_a(),
            };
            self.phase.count(&load, credible_v, trace, model, capacity);
            let rests = is_resting(current_a, capacity)
                || is_off && is_idle(&load, &trace.polarisation, model, capacity);
            return (load, rests);
        }
        let rests = cell_v.is_some_and(|cell_v| {
            self.phase
                .infer(second.duration_s, cell_v, self.load_state, trace, model)
        });
        (Load::none_for(second.duration_s), rests)
    }

    /// Keeps the pack as it is counted now. While that may not be this one, the estimate is as uncertain as the voltage of a
    /// cell contradicts it.
    fn update_reference(&mut self, load: &Load, second: &Second, cell_v: Option<f32>, model: &CellModel) {
        let (Some(estimate), Some(cell_v)) = (&mut self.estimate, cell_v) else {
            return;
        };
        let now = Reference::new(estimate.by_itself.soc, cell_v, load, model);
        match (&mut self.reference, self.doubt) {
            (reference, Doubt::None) => {
                let is_counted = matches!(self.phase, Phase::Counting(_));
                *reference = is_counted.then_some(now);
            }
            (Some(before), Doubt::ContactLoss) => {
                if let Some(capacity) = model.capacity() {
                    let drawn_ah = load.drawn_ah() + second.unread.unmeasured_ah;
                    before.draw(drawn_ah / capacity.ah, model);
                }
                let (_, contradiction) = before.compare(&now, model);
                for sigma in [&mut estimate.sigma, &mut estimate.usable_sigma] {
                    *sigma = root_of_squares(*sigma, contradiction);
                }
            }
            _ => {}
        }
    }

    /// Evaluates a rest: learns the pack, or corrects the estimate.
    fn evaluate(
        &mut self,
        rest: &Rest,
        load: &Load,
        cell_v: f32,
        origin: CurrentOrigin,
        model: &CellModel,
    ) -> Option<LearntPack> {
        let Phase::Counting(counting) = &mut self.phase else {
            return None;
        };
        let learnt = counting.learn(load, cell_v, model);
        match (&learnt, model.capacity()) {
            (Some(_), _) => self.trace.reserve.restart(),
            (None, Some(capacity)) => counting.rest(rest, load, cell_v, origin, model, &capacity),
            (None, None) => {}
        }
        learnt
    }

    /// Ends a drive before this start, if the pack has been found at rest.
    fn end_lesson(&self, rest: &Load, cell_v: f32, model: &CellModel) -> Option<LearntPack> {
        let (Phase::Counting(_), Some(capacity), Some(lesson)) =
            (&self.phase, model.capacity(), &model.learnt.open)
        else {
            return None;
        };
        let mut drive = Drive::reopened(lesson);
        let by_voltage = Filter::from_voltage(rest, cell_v, model, &capacity);
        let is_the_same = drive.may_end_at(&by_voltage, model.learnt, &capacity);
        let learnt = is_the_same.then(|| drive.learn(rest, cell_v, model)).flatten();
        let mut ended = learnt.unwrap_or(*model.learnt).without_open_lesson();
        let (counted, _) = drive.soc(&capacity);
        if let Some(collapse) = ended.collapse.filter(|collapse| counted <= collapse.soc()) {
            let learnt_capacity = CellModel {
                learnt: &ended,
                ..*model
            }
            .capacity();
            let (corrected, _) = drive.soc(&learnt_capacity.unwrap_or(capacity));
            ended.collapse = collapse.corrected(corrected - counted);
        }
        Some(ended)
    }

    /// The drive that has only to rest.
    fn open_lesson(&self, model: &CellModel) -> Option<OpenLesson> {
        match (&self.phase, self.lesson_obstacle(model)) {
            (Phase::Counting(counting), Some(LessonObstacle::NoRest)) => counting.drive()?.open(),
            _ => None,
        }
    }

    /// Why the drive so far has taught nothing; `None` if it has.
    pub fn lesson_obstacle(&self, model: &CellModel) -> Option<LessonObstacle> {
        let counting = match &self.phase {
            Phase::Counting(counting) => counting,
            Phase::VoltageOnly(_) => return Some(LessonObstacle::NoCurrent),
            Phase::Starting(_) | Phase::Known(_) => return Some(LessonObstacle::UnknownStart),
        };
        let Some(drive) = counting.drive() else {
            return Some(LessonObstacle::UnknownStart);
        };
        if drive.has_taught() {
            return None;
        }
        let by_rest = if self.rest.is_evaluated() {
            LessonObstacle::Implausible
        } else {
            LessonObstacle::NoRest
        };
        drive.obstacle(model).or(Some(by_rest))
    }

    /// The record of the pack under this load, for flash: with what was learnt, if its rest has taught something.
    fn record(
        &self,
        load: &Load,
        cell_v: f32,
        learnt: Option<LearntPack>,
        model: &CellModel,
    ) -> Option<LearntPack> {
        let mut kept = learnt.unwrap_or(*model.learnt);
        kept.open = self.open_lesson(model);
        kept.chemistry = model.chemistry;
        kept.cell_count = model.cell_count?;
        let mut ohm = 0.0;
        if let Phase::Counting(counting) = &self.phase {
            kept.collapse = counting.collapse(model);
            ohm = counting.mean_ohm().unwrap_or(0.0);
        }
        let model = CellModel {
            learnt: &kept,
            ..*model
        };
        let estimate = self.estimate_now(model, true)?;
        kept.charge = Some(LastCharge {
            soc: estimate.soc,
            sigma: estimate.sigma,
            resting_v: cell_v + load.sag_v(ohm, model.slow_share()),
        });
        // Without what is implausible, as flash would give it back.
        LearntPack::from_words(&kept.to_words())
    }

    /// The assumptions of the estimator, for people.
    pub fn explain<'a>(&'a self, model: CellModel<'a>) -> impl Iterator<Item = Quantity> + 'a {
        let pct = |share: f32| 100.0 * share;
        let estimate = self.estimate.map(|estimate| {
            [
                ("state of charge, %", pct(estimate.soc), Some(pct(estimate.sigma))),
                (
                    "usable charge, %",
                    pct(estimate.usable_soc),
                    Some(pct(estimate.usable_sigma)),
                ),
            ]
        });
        let capacity = model.capacity().map(|capacity| {
            (
                "capacity, mAh",
                1e3 * capacity.ah,
                Some(1e3 * capacity.ah * capacity.sigma),
            )
        });
        let resistance = model
            .known_ohm()
            .map(|ohm| ("resistance of a cell, mΩ", 1e3 * ohm, None));
        let counting = match &self.phase {
            Phase::Counting(counting) => Some(counting.explain(&model)),
            Phase::Starting(_) | Phase::Known(_) | Phase::VoltageOnly(_) => None,
        };
        let estimate = estimate.into_iter().flatten();
        estimate
            .chain(self.trace.reserve.explain())
            .chain(capacity)
            .chain(resistance)
            .chain(counting.into_iter().flatten())
    }

    /// The method of the estimate, for people.
    pub fn method(&self) -> &'static str {
        match &self.phase {
            Phase::Starting(_) => "no charge is known yet",
            Phase::Known(_) => "the charge is one that was kept or set",
            Phase::Counting(counting) if counting.filter.is_from_voltage() => {
                "the current is counted from a charge that a voltage has shown"
            }
            Phase::Counting(_) => "the current is counted from a charge that is certain",
            Phase::VoltageOnly(_) => "the load is inferred from the voltage",
        }
    }

    fn estimate_now(&self, model: CellModel, rests: bool) -> Option<ChargeEstimate> {
        let by_itself = self.phase.charge(&self.trace, &model)?;
        let KnownCharge { soc, sigma } = by_itself;
        let soc = soc.min(model.soc_at_most).max(0.0);
        let label_sigma = self.phase.label_sigma(&model);
        let sigma = root_of_squares(sigma, label_sigma).min(model.soc_at_most);
        Some(ChargeEstimate {
            soc,
            sigma,
            available: self.trace.reserve.available(soc),
            usable_soc: self.trace.reserve.usable(soc),
            usable_sigma: self.trace.reserve.usable_sigma(soc, sigma),
            rate_per_h: match &self.phase {
                Phase::VoltageOnly(estimate) => estimate.rate_per_h(),
                Phase::Starting(_) | Phase::Known(_) | Phase::Counting(_) => None,
            },
            by_itself,
            rests,
        })
    }
}

impl Phase {
    /// Takes a second whose current was measured.
    fn count(
        &mut self,
        load: &Load,
        cell_v: Option<f32>,
        trace: &mut Trace,
        model: &CellModel,
        capacity: &Capacity,
    ) {
        match self {
            Self::Starting(start) => {
                let found = cell_v.and_then(|cell_v| start.update(load, cell_v, model, capacity));
                if let Some(found) = found {
                    if found.has_rested {
                        trace.polarisation = Polarisation::at_rest();
                    }
                    *self = Self::Counting(Counting::from_found(found.filter));
                }
            }
            Self::Known(charge) => *self = Self::counting_from(*charge, model, capacity),
            Self::VoltageOnly(estimate) => {
                trace.polarisation = Polarisation::unknown();
                *self = match estimate.charge() {
                    Some(charge) => Self::counting_from(charge, model, capacity),
                    None => Self::Starting(Start::NEW),
                }
            }
            Self::Counting(counting) => counting.update(load, cell_v, trace, model, capacity),
        }
    }

    /// Whether the charge is found. Until then the estimate by the voltage alone of a pack under load rises to what that shows.
    fn is_settled(&self) -> bool {
        match self {
            Self::Starting(_) | Self::Known(_) | Self::Counting(_) => true,
            Self::VoltageOnly(estimate) => estimate.is_settled(),
        }
    }

    fn counting_from(charge: KnownCharge, model: &CellModel, capacity: &Capacity) -> Self {
        let filter = Filter::from_soc(charge.soc, charge.sigma, model, capacity);
        Self::Counting(Counting::from_known(filter))
    }

    /// Takes the voltage of a cell in a second whose current was not measured, and infers the load from it. Returns whether
    /// the pack rests.
    fn infer(
        &mut self,
        dt_s: f32,
        cell_v: f32,
        load_state: LoadState,
        trace: &mut Trace,
        model: &CellModel,
    ) -> bool {
        let estimate = match self {
            Self::VoltageOnly(estimate) => return estimate.infer(dt_s, cell_v, load_state, trace, model),
            // Readings without a current between others.
            Self::Counting(_) => return false,
            Self::Starting(_) => VoltageOnly::from_voltage(cell_v, load_state, model),
            Self::Known(charge) => VoltageOnly::from_soc(charge.soc, charge.sigma),
        };
        trace.polarisation = Polarisation::at_rest();
        *self = Self::VoltageOnly(estimate);
        false
    }

    /// A charge was drawn that no measured current shows. Before the first estimate, and where it is one by the voltage, this
    /// shows it.
    fn draw(&mut self, charge_ah: f32, capacity: &Capacity) {
        if charge_ah <= 0.0 {
            return;
        }
        match self {
            Self::Starting(_) | Self::VoltageOnly(_) => {}
            Self::Known(charge) => charge.soc = (charge.soc - charge_ah / capacity.ah).max(0.0),
            Self::Counting(counting) => counting.draw(charge_ah, capacity),
        }
    }

    /// Standard deviation of the charge by what a rated capacity is known worse than the estimate assumes.
    fn label_sigma(&self, model: &CellModel) -> f32 {
        let (Self::Counting(counting), Some(capacity)) = (self, model.capacity()) else {
            return 0.0;
        };
        let drive = counting.certain_drive();
        drive.map_or(0.0, |drive| model.label_sigma(drive.used(&capacity)))
    }

    /// The charge now, once there is an estimate.
    fn charge(&self, trace: &Trace, model: &CellModel) -> Option<KnownCharge> {
        match self {
            Self::Starting(start) => start.provisional(),
            Self::Known(charge) => Some(*charge),
            Self::Counting(Counting { filter, .. }) => {
                let drawn = trace.block.drawn_ah() / model.capacity()?.ah;
                Some(KnownCharge {
                    soc: filter.soc() - drawn * filter.counted(),
                    sigma: filter.sigma(),
                })
            }
            Self::VoltageOnly(estimate) => estimate.charge(),
        }
    }
}
