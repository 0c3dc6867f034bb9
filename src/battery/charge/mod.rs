//! State of charge: counted where the current is measured, corrected by the voltage; learnt from drive to drive.
//!
//! Sums are kept at every reading; everything else runs once a second, and the comparison with the model once in ten.

mod block;
mod cell_model;
mod deviation;
mod drive;
mod filter;
mod memory;
mod polarisation;
mod rest_timer;
mod second;
mod start;
mod usable;
mod voltage_only;

pub(super) use cell_model::{Capacity, CellModel};
pub(super) use memory::KnownCharge;
pub(super) use second::Second;

use super::learnt::LastCharge;
use super::{ArmState, LearntPack};
use block::{Block, BlockSum, HOURS_PER_SECOND, Load};
use drive::Drive;
use filter::{Filter, Fit};
use polarisation::Polarisation;
use rest_timer::RestTimer;
use second::Gathering;
use start::{Found, Start, charged, is_resting};
use usable::Reserve;
use voltage_only::VoltageOnly;

/// After a longer time without a reading, in seconds, the load meanwhile is taken for that of the time before: one
/// reading does not represent that much time.
const GAP_S: f32 = 15.0;

/// After a longer gap the estimate restarts, in seconds.
const MAX_GAP_S: f32 = 600.0;

/// Standard deviation of a load in a gap, in capacities per hour.
const GAP_RATE_PER_H: f32 = 1.0;

/// A voltage that is further from the expected one, in standard deviations, contradicts the estimate: no cell of the
/// chemistry has it, since published curves lie less far from their mean. What exceeds that, up to the second figure, is
/// summed over time, what falls below is subtracted; at the third, in standard deviations times seconds, the estimate
/// restarts: within a minute to two.
const CONTRADICTION: f32 = 3.0;
const MAX_EXCESS: f32 = 0.5;
const MAX_CONTRADICTION_S: f32 = 25.0;

/// Estimates the charge of one pack, and learns the pack.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChargeEstimator {
    gathering: Gathering,
    phase: Phase,
    /// Of the current in amperes; of the load in capacities per hour where it is inferred from the voltage.
    polarisation: Polarisation,
    block: BlockSum,
    reserve: Reserve,
    contradicted_s: f32,
    drive: Option<Drive>,
    rest: RestTimer,
    arm_state: ArmState,
    estimate: Option<ChargeEstimate>,
}

/// How the charge is estimated.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Not yet.
    Starting(Start),
    /// From a state of charge that is known.
    Known(KnownCharge),
    /// By the current.
    Counting(Filter),
    /// By the voltage alone.
    VoltageOnly(VoltageOnly),
}

/// The estimate of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChargeEstimate {
    /// State of charge, from 0 to 1.
    pub share: f32,
    /// Its standard deviation.
    pub sigma: f32,
    /// What such a load can still draw, relative to the capacity, from 0 to 1.
    pub available: f32,
    /// The same relative to what it can draw from a full pack.
    pub usable_share: f32,
    /// Charge drawn, in capacities per hour, where the current is not measured.
    pub rate_per_h: Option<f32>,
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
            share: charge.share,
            sigma: charge.sigma,
            available: charge.share,
            usable_share: charge.share,
            rate_per_h: None,
        });
        known
    }

    const fn in_phase(phase: Phase) -> Self {
        Self {
            gathering: Gathering::NEW,
            phase,
            polarisation: Polarisation::unknown(),
            block: BlockSum::NEW,
            reserve: Reserve::NEW,
            contradicted_s: 0.0,
            drive: None,
            rest: RestTimer::new(),
            arm_state: ArmState::Disarmed,
            estimate: None,
        }
    }

    /// The latest estimate, if there is one.
    pub fn estimate(&self) -> Option<&ChargeEstimate> {
        self.estimate.as_ref()
    }

    /// What is kept over a reset.
    pub fn known(&self) -> Option<KnownCharge> {
        let ChargeEstimate { share, sigma, .. } = self.estimate?;
        Some(KnownCharge { share, sigma })
    }

    /// The owner says that this is another pack. Under load, counting goes on: a start there is worse.
    pub fn change_pack(&mut self) {
        match self.arm_state {
            ArmState::Disarmed => *self = Self::new(),
            ArmState::Armed => self.restart_drive(),
        }
    }

    /// What was seen of the pack so far must not be learnt.
    pub fn restart_drive(&mut self) {
        if let (Some(drive), Phase::Counting(filter)) = (&mut self.drive, &self.phase) {
            *drive = Drive::new(filter);
        }
    }

    /// Takes a reading, with the charge that its source has counted beyond the current, and returns the means of a second
    /// that it completes.
    pub fn add(
        &mut self,
        dt_s: f32,
        voltage_v: Option<f32>,
        current_a: Option<f32>,
        unmeasured_ah: f32,
    ) -> Option<Second> {
        if dt_s > MAX_GAP_S {
            *self = Self::new();
        }
        if let Phase::Starting(start) = &mut self.phase {
            start.add(dt_s, voltage_v, current_a);
        }
        self.gathering.add_unmeasured(unmeasured_ah);
        if dt_s > GAP_S
            && let (Phase::Counting(filter), Some(before_a)) = (&mut self.phase, self.polarisation.mean_a())
        {
            let sigma = GAP_RATE_PER_H * HOURS_PER_SECOND * dt_s;
            filter.doubt(sigma);
            if let Some(drive) = &mut self.drive {
                drive.doubt(sigma);
            }
            return self
                .gathering
                .add(dt_s, None, Some(current_a.unwrap_or(before_a)));
        }
        self.gathering.add(dt_s, voltage_v, current_a)
    }

    /// Takes a second. Returns what is to be kept of the pack, when it was learnt or came to rest.
    pub fn update(&mut self, second: &Second, arm_state: ArmState, model: &CellModel) -> Option<LearntPack> {
        let count = f32::from(model.cell_count?);
        let cell_v = second.voltage_v.map(|voltage_v| voltage_v / count);
        let was_disarmed = core::mem::replace(&mut self.arm_state, arm_state) == ArmState::Armed
            && arm_state == ArmState::Disarmed;
        let capacity = model.capacity();
        if let Some(capacity) = &capacity {
            self.draw(second.unmeasured_ah, capacity);
        }
        let (load, rests) = match (second.current_a, capacity) {
            (Some(current_a), Some(capacity)) => {
                self.polarisation.update(second.duration_s, current_a);
                let load = Load {
                    duration_s: second.duration_s,
                    current_a,
                    slow_a: self.polarisation.current_a(),
                };
                self.count(&load, cell_v, model, &capacity);
                (load, is_resting(current_a, &capacity))
            }
            _ => {
                let load = Load {
                    duration_s: second.duration_s,
                    ..Load::NONE
                };
                let rests = self.infer(second.duration_s, cell_v, arm_state, model);
                (load, rests)
            }
        };
        if !rests {
            self.rest = RestTimer::new();
        }
        let kept = if rests && self.rest.rest(load.duration_s) {
            let learnt = self.learn(&load, cell_v, model);
            self.keep(&load, cell_v, learnt, model)
        } else if was_disarmed {
            self.keep(&load, cell_v, None, model)
        } else {
            None
        };
        self.estimate = self.estimate_now(
            kept.as_ref()
                .map_or(*model, |learnt| CellModel { learnt, ..*model }),
        );
        kept
    }

    fn count(&mut self, load: &Load, cell_v: Option<f32>, model: &CellModel, capacity: &Capacity) {
        match &mut self.phase {
            Phase::Starting(start) => {
                let found = cell_v.and_then(|cell_v| start.update(load, cell_v, model, capacity));
                if let Some(found) = found {
                    self.begin_counting(&found);
                }
            }
            Phase::Known(charge) => {
                self.phase = Phase::Counting(Filter::from_share(charge.share, charge.sigma, model, capacity));
            }
            Phase::VoltageOnly(estimate) => {
                self.polarisation = Polarisation::unknown();
                self.phase = match estimate.share() {
                    Some(share) => {
                        Phase::Counting(Filter::from_share(share, estimate.sigma(), model, capacity))
                    }
                    None => Phase::Starting(Start::NEW),
                }
            }
            Phase::Counting(filter) => {
                if let Some(cell_v) = cell_v {
                    self.reserve
                        .update(load.duration_s, model.voltage_v(filter.share()) - cell_v);
                }
                if let Some(block) = self.block.add(load, cell_v) {
                    self.compare(&block, model, capacity);
                }
            }
        }
    }

    /// A charge was drawn that no measured current shows. Before the first estimate the voltage shows it.
    fn draw(&mut self, charge_ah: f32, capacity: &Capacity) {
        if charge_ah <= 0.0 {
            return;
        }
        match &mut self.phase {
            Phase::Starting(_) => {}
            Phase::Known(charge) => charge.share = (charge.share - charge_ah / capacity.ah).max(0.0),
            Phase::Counting(filter) => {
                filter.draw(charge_ah / capacity.ah);
                if let Some(drive) = &mut self.drive {
                    drive.draw(charge_ah);
                }
            }
            Phase::VoltageOnly(estimate) => estimate.draw(charge_ah / capacity.ah),
        }
    }

    fn begin_counting(&mut self, found: &Found) {
        let filter = match found {
            Found::Rested(filter) => {
                self.polarisation = Polarisation::at_rest();
                filter
            }
            Found::UnderLoad(filter) => filter,
        };
        self.drive = Some(Drive::new(filter));
        self.phase = Phase::Counting(*filter);
    }

    fn compare(&mut self, block: &Block, model: &CellModel, capacity: &Capacity) {
        let Phase::Counting(filter) = &mut self.phase else {
            return;
        };
        if let Some(drive) = &mut self.drive {
            drive.add(block, filter.share(), model, capacity);
        }
        let is_charging = block.load.current_a < 0.0;
        if let Some(Fit { deviations }) = filter.update(block, model, capacity) {
            let excess = (deviations.abs() - CONTRADICTION).min(MAX_EXCESS);
            self.contradicted_s = (self.contradicted_s + excess * block.load.duration_s).max(0.0);
        }
        filter.settle(self.polarisation.lasting_a(), model, capacity);
        if self.contradicted_s >= MAX_CONTRADICTION_S
            && let Some(cell_v) = block.cell_v
        {
            self.contradicted_s = 0.0;
            *filter = Filter::from_voltage(&block.load, cell_v, model, capacity);
        }
        if let Some(charged) = charged(block, model, capacity) {
            *filter = charged;
        }
        if is_charging && filter.share() >= 1.0 {
            self.drive = Some(Drive::new(filter));
        }
        self.reserve.settle(model);
    }

    /// Infers the load from the voltage. Returns whether the pack rests.
    fn infer(&mut self, dt_s: f32, cell_v: Option<f32>, arm_state: ArmState, model: &CellModel) -> bool {
        let Some(cell_v) = cell_v else {
            return false;
        };
        match &mut self.phase {
            Phase::Starting(_) => {
                self.infer_from(VoltageOnly::from_voltage(cell_v, arm_state, model));
            }
            Phase::Known(KnownCharge { share, sigma }) => {
                let estimate = VoltageOnly::from_share(*share, *sigma);
                self.infer_from(estimate);
            }
            Phase::VoltageOnly(estimate) => {
                let slow_per_h = self.polarisation.current_a();
                let rests = estimate.update(dt_s, cell_v, slow_per_h, arm_state, model);
                self.polarisation.update(dt_s, estimate.load_per_h(model));
                self.reserve.update(dt_s, estimate.sag_v());
                let second = Load {
                    duration_s: dt_s,
                    ..Load::NONE
                };
                if self.block.add(&second, None).is_some() {
                    estimate.assess(model);
                    self.reserve.settle(model);
                }
                return rests;
            }
            // Readings without a current between others.
            Phase::Counting(_) => {}
        }
        false
    }

    fn infer_from(&mut self, estimate: VoltageOnly) {
        self.polarisation = Polarisation::at_rest();
        self.phase = Phase::VoltageOnly(estimate);
    }

    /// Learns the pack when it has rested, and continues with what its charge has to be then.
    fn learn(&mut self, rest: &Load, cell_v: Option<f32>, model: &CellModel) -> Option<LearntPack> {
        let drive = self.drive.as_mut()?;
        let learnt = drive.learn(rest, cell_v?, model)?;
        if let Phase::Counting(filter) = &mut self.phase {
            let model = CellModel {
                learnt: &learnt,
                ..*model
            };
            if let Some(capacity) = model.capacity() {
                let (share, sigma) = drive.share(&capacity);
                *filter = Filter::from_share(share, sigma, &model, &capacity);
            }
        }
        Some(learnt)
    }

    /// What is kept of a pack that rests.
    fn keep(
        &self,
        rest: &Load,
        cell_v: Option<f32>,
        learnt: Option<LearntPack>,
        model: &CellModel,
    ) -> Option<LearntPack> {
        let cell_v = cell_v?;
        let mut kept = learnt.unwrap_or(*model.learnt);
        kept.chemistry = model.chemistry;
        kept.cell_count = model.cell_count?;
        let ohm = self.drive.as_ref().and_then(Drive::mean_ohm).unwrap_or(0.0);
        let estimate = self.estimate_now(CellModel {
            learnt: &kept,
            ..*model
        })?;
        kept.charge = Some(LastCharge {
            share: estimate.share,
            sigma: estimate.sigma,
            resting_v: cell_v + rest.sag_v(ohm, model.cell.slow_share),
        });
        // Without what is implausible, as flash would give it back.
        LearntPack::from_words(&kept.to_words())
    }

    fn estimate_now(&self, model: CellModel) -> Option<ChargeEstimate> {
        let (share, sigma, rate_per_h) = match &self.phase {
            Phase::Starting(start) => {
                let KnownCharge { share, sigma } = start.provisional()?;
                (share, sigma, None)
            }
            Phase::Known(charge) => (charge.share, charge.sigma, None),
            Phase::Counting(filter) => {
                let drawn = self.block.drawn_ah() / model.capacity()?.ah;
                (filter.share() - drawn * filter.counted(), filter.sigma(), None)
            }
            Phase::VoltageOnly(estimate) => (estimate.share()?, estimate.sigma(), estimate.rate_per_h()),
        };
        let share = share.min(model.share_at_most).max(0.0);
        let sigma = sigma.min(model.share_at_most);
        Some(ChargeEstimate {
            share,
            sigma,
            available: self.reserve.available(share),
            usable_share: self.reserve.usable(share),
            rate_per_h,
        })
    }
}
