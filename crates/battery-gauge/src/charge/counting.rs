//! Counting of the current from a charge that was found, corrected by the voltage.

use super::cell_model::{Capacity, CellModel, KnownCharge};
use super::drive::{Drive, Rest};
use super::filter::{Filter, has_plateau};
use super::load::{Block, CurrentOrigin, HOURS_PER_SECOND, Load, Quantity, SILENCE_S, SagGrowth, Trace};
use super::start::{
    Relaxation, charged, full, is_resting, kept_full, may_have_surface_charge, provisional, was_charged,
};
use super::voltage_only::VoltageOnly;
use crate::LearntPack;
use crate::learnt::Collapse;

/// A voltage that is further from the expected one, in standard deviations, contradicts the estimate: no cell of the
/// chemistry has it, since published curves lie less far from their mean. What exceeds that, up to the second figure, is
/// summed over time, what falls below is subtracted; at the third, in standard deviations times seconds, the estimate
/// restarts: within a minute to two.
const CONTRADICTION: f32 = 3.0;
const MAX_EXCESS: f32 = 0.5;
const MAX_CONTRADICTION_S: f32 = 25.0;

/// A start that was taken too low shows before this charge was drawn, in capacities. A voltage that is too high only later is that
/// of a cell whose capacity or curve is another.
const START_SHOWN: f32 = 0.2;

/// An estimate by the current, and what is seen of the pack meanwhile.
#[derive(Clone, Copy, Debug)]
pub struct Counting {
    pub filter: Filter,
    /// Since the charge was certain.
    drive: Option<Drive>,
    relaxation: Relaxation,
    collapse: LastCollapse,
    contradicted_s: f32,
}

impl Counting {
    /// From a charge that is known, but was not found by the voltage: nothing is learnt until the next full charge.
    pub fn from_known(filter: Filter) -> Self {
        Self {
            filter,
            drive: None,
            relaxation: Relaxation::Unknown,
            collapse: LastCollapse::Learnt,
            contradicted_s: 0.0,
        }
    }

    /// From a charge that was found by the voltage.
    pub fn from_found(filter: Filter) -> Self {
        Self {
            drive: Some(Drive::new(&filter)),
            ..Self::from_known(filter)
        }
    }

    /// Discards the observations so far: they must not be learnt.
    pub fn restart_drive(&mut self) {
        if let Some(drive) = &mut self.drive {
            *drive = Drive::new(&self.filter);
        }
    }

    /// The current is made of another source. The present charge is as uncertain for a lesson as what was counted of it.
    pub fn change_current(&mut self) {
        if let Some(drive) = &mut self.drive {
            let counted = drive.start_soc() - self.filter.soc();
            *drive = Drive::new(&self.filter);
            drive.widen(counted.abs());
        }
    }

    /// A charge with this standard deviation, in capacities, was drawn unseen.
    pub fn inflate(&mut self, sigma: f32) {
        self.filter.inflate(sigma);
        if let Some(drive) = &mut self.drive {
            drive.inflate(sigma);
        }
    }

    /// Of the charge that was counted this much was assumed, in ampere-hours. As it may be wrong in one direction all the
    /// time, the lesson is less certain by all of it.
    pub fn assume(&mut self, charge_ah: f32, capacity: &Capacity) {
        if let Some(drive) = &mut self.drive {
            drive.widen(charge_ah / capacity.ah);
        }
    }

    /// Of the charge that was counted this much, in ampere-hours, was at least so much: as much again may have been drawn.
    pub fn exceed_range(&mut self, charge_ah: f32, capacity: &Capacity) {
        self.filter.widen(charge_ah / capacity.ah);
        self.assume(charge_ah, capacity);
    }

    /// A charge was drawn that no measured current shows, in ampere-hours.
    pub fn draw(&mut self, charge_ah: f32, capacity: &Capacity) {
        self.filter.draw(charge_ah / capacity.ah);
        if let Some(drive) = &mut self.drive {
            drive.draw(charge_ah);
        }
    }

    /// The estimate to go on with when the current is lost: for [`SILENCE_S`] the pack has drawn what it drew before.
    pub fn by_voltage(&self, trace: &Trace, model: &CellModel) -> VoltageOnly {
        let KnownCharge { soc, sigma } = self.filter.charge();
        let counted_ah = trace.block.drawn_ah() * self.filter.counted();
        let assumed_ah = trace.polarisation.mean_a().unwrap_or(0.0) * SILENCE_S * HOURS_PER_SECOND;
        let drawn = model
            .capacity()
            .map_or(0.0, |capacity| (counted_ah + assumed_ah) / capacity.ah);
        VoltageOnly::from_soc((soc - drawn.max(0.0)).max(0.0), sigma)
    }

    /// Takes a second.
    pub fn update(
        &mut self,
        load: &Load,
        cell_v: Option<f32>,
        trace: &mut Trace,
        model: &CellModel,
        capacity: &Capacity,
    ) {
        if let Some(cell_v) = cell_v {
            trace.reserve.add(cell_v, self.filter.soc(), model);
        }
        if let Some(block) = trace.block.add(load, cell_v) {
            self.compare(&block, trace, model, capacity);
            if let Some(cell_v) = block.cell_v {
                let soc = self.filter.soc();
                let growth = SagGrowth::NearEmpty;
                let is_carried = trace
                    .reserve
                    .update(block.load.duration_s, cell_v, soc, growth, model);
                if !is_resting(block.load.current_a, capacity) {
                    let ohm = self.mean_ohm();
                    self.collapse.update(soc, cell_v, ohm, is_carried, model);
                }
            }
            trace
                .reserve
                .compute(SagGrowth::NearEmpty, self.collapse(model), model);
        }
    }

    /// The charge at which the pack is expected to collapse again.
    pub fn collapse(&self, model: &CellModel) -> Option<Collapse> {
        self.collapse.expected(model.learnt.collapse)
    }

    /// Compares a block with the model.
    fn compare(&mut self, block: &Block, trace: &mut Trace, model: &CellModel, capacity: &Capacity) {
        if was_charged(&block.load, capacity) {
            self.relaxation = Relaxation::Unknown;
        }
        let is_provisional = self.is_provisional();
        if let Some(drive) = &mut self.drive {
            drive.add(block, self.filter.soc(), model, capacity);
        }
        let compared = Block {
            cell_v: block.cell_v.filter(|_| !is_provisional),
            ..*block
        };
        if let Some(deviations) = self.filter.update(&compared, model, capacity) {
            let excess = (self.contradiction(deviations, capacity) - CONTRADICTION).min(MAX_EXCESS);
            self.contradicted_s = (self.contradicted_s + excess * block.load.duration_s).max(0.0);
        }
        self.keep_to_count(capacity);
        let filter = &mut self.filter;
        filter.update_voltage_variance(trace.polarisation.lasting_a(), model, capacity);
        if self.contradicted_s >= MAX_CONTRADICTION_S
            && let Some(cell_v) = block.cell_v
        {
            self.contradicted_s = 0.0;
            self.relaxation = Relaxation::Unknown;
            let estimated = filter.soc();
            *filter = provisional(Filter::from_voltage(&block.load, cell_v, model, capacity));
            self.collapse.correct(filter.soc() - estimated);
            trace.reserve.restart();
        }
        if was_charged(&block.load, capacity) {
            trace.reserve.charge();
        }
        if let Some(charged) = charged(block, model, capacity) {
            *filter = charged;
            trace.reserve.restart();
        }
        if block.load.current_a < 0.0 && filter.soc() >= 1.0 {
            self.drive = Some(Drive::new(filter));
        }
    }

    /// The drive, if it began with a charge that was certain.
    pub fn certain_drive(&self) -> Option<&Drive> {
        self.drive.as_ref().filter(|_| !self.filter.is_from_voltage())
    }

    /// By how many standard deviations a voltage that exceeds the expected one by these contradicts the estimate.
    fn contradiction(&self, deviations: f32, capacity: &Capacity) -> f32 {
        let has_shown_start = self
            .certain_drive()
            .is_some_and(|drive| drive.used(capacity) > START_SHOWN);
        if has_shown_start && deviations > 0.0 {
            0.0
        } else {
            deviations.abs()
        }
    }

    /// Until it contradicts the start, a voltage corrects a count from a certain charge by no more than the standard deviation of
    /// that count: the curve of this cell may be another one.
    fn keep_to_count(&mut self, capacity: &Capacity) {
        if let Some(drive) = self.certain_drive() {
            let (soc, sigma) = drive.soc(capacity);
            self.filter.keep_within(soc, sigma);
        }
    }

    /// Whether the voltage may be too high for this charge, as it is right after charging. A certain charge was not read from it.
    fn is_provisional(&self) -> bool {
        self.relaxation == Relaxation::Unknown
            && may_have_surface_charge(&self.filter)
            && self.filter.is_from_voltage()
    }

    /// Takes the voltage of a cell that rests as one measurement. What the offset of the current sensor has counted meanwhile is
    /// unknown; what has charged the pack, too, unless its current was measured.
    pub fn rest(
        &mut self,
        rest: &Rest,
        load: &Load,
        cell_v: f32,
        origin: CurrentOrigin,
        model: &CellModel,
        capacity: &Capacity,
    ) {
        if rest.relaxation == Relaxation::Relaxed {
            self.relaxation = Relaxation::Relaxed;
        }
        let mut by_voltage = Filter::from_voltage(load, cell_v, model, capacity);
        if self.relaxation == Relaxation::Unknown {
            by_voltage = provisional(by_voltage);
        }
        let may_be_charged = origin == CurrentOrigin::SourceCounter && by_voltage.soc() > self.filter.soc();
        let is_provisional = self.is_provisional();
        let filter = &mut self.filter;
        filter.inflate(Drive::rest_drift(rest.duration_s));
        if is_provisional && may_have_surface_charge(&by_voltage) {
            if by_voltage.soc() < filter.soc() || may_be_charged {
                *filter = by_voltage;
            }
        } else {
            if may_be_charged {
                filter.inflate(by_voltage.soc() - filter.soc());
            }
            filter.rest(&by_voltage);
        }
        if has_plateau(model)
            && let Some(full) = full(&by_voltage, rest.relaxation, model, capacity)
                .or_else(|| kept_full(rest.rested_s, cell_v, model, capacity))
        {
            *filter = full;
        }
        if let Some(drive) = &mut self.drive {
            drive.rest(filter, &by_voltage, capacity);
        }
    }

    /// Learns the pack when it has rested, and continues with what its charge has to be then.
    pub fn learn(&mut self, rest: &Load, cell_v: f32, model: &CellModel) -> Option<LearntPack> {
        let drive = self.drive.as_mut()?;
        let learnt = drive.learn(rest, cell_v, model)?;
        let model = CellModel {
            learnt: &learnt,
            ..*model
        };
        if let Some(capacity) = model.capacity() {
            let (soc, sigma) = drive.soc(&capacity);
            self.collapse.correct(soc - self.filter.soc());
            self.filter = Filter::counted_to(soc, sigma, &model, &capacity);
        }
        Some(learnt)
    }

    /// See [`ChargeEstimator::explain`](super::ChargeEstimator::explain).
    pub fn explain(&self, model: &CellModel) -> impl Iterator<Item = Quantity> + use<> {
        let [capacity, offset, slow_share] = self.filter.corrections(model);
        let drive = self
            .drive
            .as_ref()
            .zip(model.capacity())
            .map(|(drive, capacity)| {
                let (soc, sigma) = drive.soc(&capacity);
                let drawn_pct = 100.0 * drive.used(&capacity);
                [
                    ("drawn since a charge was certain, %", drawn_pct, None),
                    (
                        "charge by counting from there, %",
                        100.0 * soc,
                        Some(100.0 * sigma),
                    ),
                ]
            });
        let corrections = [
            (
                "capacity, corrected, %",
                100.0 * capacity.0,
                Some(100.0 * capacity.1),
            ),
            (
                "curve above the expected one, mV",
                1e3 * offset.0,
                Some(1e3 * offset.1),
            ),
            (
                "slow sag relative to the fast one, %",
                100.0 * slow_share.0,
                Some(100.0 * slow_share.1),
            ),
            (
                "contradicted by the voltage, % of a restart",
                100.0 * self.contradicted_s / MAX_CONTRADICTION_S,
                None,
            ),
        ];
        drive.into_iter().flatten().chain(corrections)
    }

    /// The drive so far.
    pub fn drive(&self) -> Option<&Drive> {
        self.drive.as_ref()
    }

    /// Mean resistance of a cell in this drive, in ohms.
    pub fn mean_ohm(&self) -> Option<f32> {
        self.drive.as_ref().and_then(Drive::mean_ohm)
    }
}

/// At a higher charge, from 0 to 1, a stalled motor takes a cell below the end.
const HIGHEST: f32 = 0.5;

/// A cell whose mean over ten seconds is less above the end, in volts, has collapsed: a failsafe may have ended the load meanwhile.
const COLLAPSED_V: f32 = 0.05;

/// The latest collapse of a pack under load, earlier than its reserve expects, as this drive has shown it: the next drive warns
/// earlier.
#[derive(Clone, Copy, Debug)]
enum LastCollapse {
    /// The drive adds nothing to what is learnt.
    Learnt,
    Seen(Collapse),
    /// The drive has passed it.
    Passed,
}

impl LastCollapse {
    /// The collapse that the pack is expected to repeat.
    fn expected(&self, learnt: Option<Collapse>) -> Option<Collapse> {
        match self {
            Self::Learnt => learnt,
            Self::Seen(collapse) => Some(*collapse),
            Self::Passed => None,
        }
    }

    /// Takes the mean voltage of a cell over ten seconds of load at this state of charge from 0 to 1, and whether that load was
    /// carried, in a drive with this mean resistance of a cell, in ohms.
    fn update(&mut self, soc: f32, cell_v: f32, drive_ohm: Option<f32>, is_carried: bool, model: &CellModel) {
        if cell_v < model.terminal_end_v() + COLLAPSED_V {
            let continues = matches!(self, Self::Seen(seen) if seen.soc() >= soc);
            if !continues
                && soc < HIGHEST
                && let Some(collapse) = drive_ohm.and_then(|ohm| Collapse::new(soc, ohm))
            {
                *self = Self::Seen(collapse);
            }
        } else if is_carried
            && let Some(expected) = self.expected(model.learnt.collapse)
            && soc < expected.soc_at(model.known_ohm())
        {
            *self = Self::Passed;
        }
    }

    /// The next drive counts more by this difference at the same charge. A rest that corrects the estimate alone is no reason:
    /// the next drive starts from another charge, and counts with the same capacity.
    fn correct(&mut self, difference: f32) {
        if let Self::Seen(collapse) = self {
            *self = collapse.corrected(difference).map_or(Self::Learnt, Self::Seen);
        }
    }
}
