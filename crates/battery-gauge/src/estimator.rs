//! Estimates of a pack: resistance, resting voltage, cell count, state of charge, remaining time.

use crate::charge::Quantity;
use crate::charge::{
    CellModel, ChargeEstimate, ChargeEstimator, CurrentOrigin, EndVoltage, KnownCharge, PackIdentity,
    Reference, Sample, Second, measured_offsets,
};
use crate::event::PackEvent;
use crate::learnt::LessonObstacle;
use crate::low_pass::MeanThenLowPass;
use crate::resistance::ResistanceEstimator;
use crate::rest::{CellCount, RESTING_CURRENT_A};
use crate::settings::PackSettings;
use crate::swap::{AtRest, Doubt};
use crate::{Chemistry, CurrentRange, LearntPack, LoadState};

/// Time constants of the average loads that give the remaining time, in seconds: of the last minute, and of a drive.
const AVERAGE_TIME_CONSTANT_S: f32 = 60.0;
const DRIVE_TIME_CONSTANT_S: f32 = 1200.0;

/// The remaining time of a drive is at most this many times that of the last minute.
const MAX_TO_LAST_MINUTE: f32 = 3.0;

const NOT_DRIVEN: MeanThenLowPass = MeanThenLowPass::new(DRIVE_TIME_CONSTANT_S);

/// Below this average load the remaining time is not reported, in amperes.
const MIN_AVERAGE_LOAD_A: f32 = 0.01;

/// A state of charge is reported from this standard deviation on, and up to that one.
const MAX_SIGMA_TO_START: f32 = 0.25;
const MAX_SIGMA_TO_CONTINUE: f32 = 0.27;

const AH_PER_MAH: f32 = 0.001;
const SECONDS_PER_HOUR: f32 = 3600.0;

/// A reading of a connected pack.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Seconds since the previous reading.
    pub dt_s: f32,
    pub voltage_v: Option<f32>,
    pub current_a: Option<f32>,
    pub current_range: CurrentRange,
    /// Since the previous reading; `None` also in a long gap.
    pub mean_current_a: Option<f32>,
    /// Charge that the source has counted beyond this current, in milliampere-hours.
    pub unmeasured_mah: f32,
    /// Time of a gap without the readings that were due, in seconds: its current is assumed.
    pub missed_s: f32,
    /// The most that can be left by the source's count, from 0 to 1.
    pub soc_at_most: f32,
    /// Cells that the pack had before.
    pub known_cells: Option<u8>,
    pub load_state: LoadState,
    pub doubt: Doubt,
}

impl Reading {
    /// Charge that has gone into a pack with the load off, in milliampere-hours.
    pub fn charged_mah(&self) -> Option<f32> {
        let mean_a = self.mean_current_a?;
        let is_charging = self.load_state == LoadState::Off && mean_a < -RESTING_CURRENT_A;
        is_charging.then(|| -mean_a * self.dt_s / (SECONDS_PER_HOUR * AH_PER_MAH))
    }
}

/// Outcome of an update of the estimators.
#[derive(Clone, Copy, Debug)]
pub struct Findings {
    /// Cell detection ended.
    pub event: Option<PackEvent>,
    /// Outcome of the second, if the reading completes one.
    pub second: Option<SecondFindings>,
}

/// Outcome of a second.
#[derive(Clone, Copy, Debug)]
pub struct SecondFindings {
    /// Whether the pack is the one that was counted before a restart.
    pub identity: PackIdentity,
    /// The record to keep of the pack, if that has changed.
    pub kept: Option<LearntPack>,
}

/// Chemistry and number of cells by the settings.
pub type SetCells = (Chemistry, Option<u8>);

/// Part of the estimates that is retained over a reset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EstimatorMemory {
    pub charge: Option<KnownCharge>,
    /// With which another pack is compared.
    pub reference: Option<Reference>,
    pub estimated_for: Option<SetCells>,
    pub detected_cells: Option<u8>,
    /// The fewest cells that the pack may have by its voltages at rest; 0 before the first one.
    pub least_cells: u8,
}

/// The estimators of one pack.
#[derive(Clone, Copy, Debug)]
pub struct Estimator {
    resistance: ResistanceEstimator,
    cells: CellCount,
    /// Whether the cells are detected, and in doubt: nothing is estimated.
    cells_are_doubtful: bool,
    average_current: MeanThenLowPass,
    /// Since the first load after arming.
    drive_current: MeanThenLowPass,
    charge: ChargeEstimator,
    /// The latest estimate as it is reported, if it is certain enough.
    reported: Option<ReportedCharge>,
    /// Cells that the present estimate assumes.
    estimated_for: Option<SetCells>,
}

/// A state of charge as it is reported: the conversions are made once a second.
#[derive(Clone, Copy, Debug)]
pub struct ReportedCharge {
    /// In percent of a full pack, from 0 to 100.
    pub remaining_pct: f32,
    /// Its standard deviation.
    pub sigma_pct: f32,
    /// Usable charge, in percent of a full pack's.
    pub usable_pct: f32,
    /// Its standard deviation.
    pub usable_sigma_pct: f32,
}

impl ReportedCharge {
    /// `None` if the estimate is too uncertain, where `before` is the one before.
    fn of(estimate: &ChargeEstimate, before: Option<&Self>) -> Option<Self> {
        let max_sigma = match before {
            None => MAX_SIGMA_TO_START,
            Some(_) => MAX_SIGMA_TO_CONTINUE,
        };
        (estimate.sigma <= max_sigma).then_some(Self {
            remaining_pct: estimate.soc * 100.0,
            sigma_pct: estimate.sigma * 100.0,
            usable_pct: estimate.usable_soc * 100.0,
            usable_sigma_pct: estimate.usable_sigma * 100.0,
        })
    }
}

impl Estimator {
    pub const fn new() -> Self {
        Self {
            resistance: ResistanceEstimator::new(),
            cells: CellCount::new(),
            cells_are_doubtful: false,
            average_current: MeanThenLowPass::new(AVERAGE_TIME_CONSTANT_S),
            drive_current: NOT_DRIVEN,
            charge: ChargeEstimator::new(),
            reported: None,
            estimated_for: None,
        }
    }

    /// Delays what is done once in a second, before the first reading.
    pub fn delay(&mut self, delay_s: f32) {
        self.charge.delay(delay_s);
    }

    /// Processes a reading of a pack of which `learnt` is known.
    pub fn update(&mut self, reading: &Reading, settings: &PackSettings, learnt: &LearntPack) -> Findings {
        // By a current that is larger than it shows the resistance would seem too high, and voltage failsafes would be late.
        if let (Some(voltage_v), Some(current_a), CurrentRange::Within) =
            (reading.voltage_v, reading.current_a, reading.current_range)
        {
            self.resistance.update(reading.dt_s, voltage_v, current_a);
        }
        let event = self.detect_cells(reading, settings);
        let cells = (settings.chemistry, settings.cell_count);
        let before = self.estimated_for.replace(cells);
        let is_doubtful = settings.cell_count.is_none() && self.cells.is_doubtful();
        let was_doubtful = core::mem::replace(&mut self.cells_are_doubtful, is_doubtful);
        if before.is_some_and(|before| before != cells) || was_doubtful != is_doubtful {
            // The estimate so far was made with wrong settings, or for wrong cells.
            self.charge = ChargeEstimator::new();
        }
        let second = self.charge.add(&Sample {
            dt_s: reading.dt_s,
            voltage_v: reading.voltage_v,
            current_a: reading.mean_current_a,
            origin: match reading.current_a {
                Some(_) => CurrentOrigin::Sensor,
                None => CurrentOrigin::SourceCounter,
            },
            range: reading.current_range,
            unmeasured_ah: reading.unmeasured_mah * AH_PER_MAH,
            missed_s: reading.missed_s,
        });
        Findings {
            event,
            second: second.map(|second| self.update_second(&second, reading, settings, learnt)),
        }
    }

    fn detect_cells(&mut self, reading: &Reading, settings: &PackSettings) -> Option<PackEvent> {
        if settings.cell_count.is_some() {
            return None;
        }
        self.cells.update(
            reading.dt_s,
            reading.voltage_v?,
            reading.current_a,
            settings.chemistry,
            reading.known_cells,
        )
    }

    fn update_second(
        &mut self,
        second: &Second,
        reading: &Reading,
        settings: &PackSettings,
        learnt: &LearntPack,
    ) -> SecondFindings {
        self.resistance.solve();
        if let Some(current_a) = second.current_a {
            self.average_current.update(second.duration_s, current_a);
            self.follow_drive(second.duration_s, current_a, reading.load_state);
        }
        let model = CellModel {
            soc_at_most: reading.soc_at_most,
            ..self.model(settings, learnt)
        };
        let mut identity = PackIdentity::Same;
        if self.charge.is_exceeded_by(second, reading.doubt, &model) {
            self.charge = ChargeEstimator::new();
            self.cells = CellCount::new();
            identity = PackIdentity::Another;
        }
        let kept = self
            .charge
            .update(second, reading.load_state, reading.doubt, &model);
        self.report();
        SecondFindings { identity, kept }
    }

    /// Averages the load of a drive, pauses included.
    fn follow_drive(&mut self, dt_s: f32, current_a: f32, load_state: LoadState) {
        match load_state {
            LoadState::Off => self.drive_current = NOT_DRIVEN,
            LoadState::On if self.drive_current.value().is_none() && current_a < RESTING_CURRENT_A => {}
            LoadState::On => self.drive_current.update(dt_s, current_a),
        }
    }

    /// Resolves a doubt when the pack rests: the charge of another one, or one that was read from another voltage, is
    /// estimated from its voltage.
    pub fn resolve(
        &mut self,
        at_rest: &AtRest,
        reading: &Reading,
        settings: &PackSettings,
        learnt: &LearntPack,
    ) -> PackIdentity {
        let model = self.model(settings, learnt);
        if let AtRest::Rescaled(_) = at_rest {
            // Others may fit.
            self.cells = CellCount::new();
        }
        let Some(count) = model.cell_count else {
            return PackIdentity::Same;
        };
        let cell = |resting_v: f32| resting_v / f32::from(count);
        let current_a = reading.current_a.unwrap_or(0.0);
        let identity = match *at_rest {
            AtRest::Replaced(_) => PackIdentity::Another,
            AtRest::Similar(resting_v) => self.charge.compare(cell(resting_v), current_a, &model),
            AtRest::Rescaled(resting_v) => self.charge.rescale(cell(resting_v), current_a, &model),
        };
        if identity == PackIdentity::Another {
            self.cells = CellCount::new();
        }
        identity
    }

    /// Why the drive so far has taught nothing; `None` if it has.
    pub fn lesson_obstacle(&self, settings: &PackSettings, learnt: &LearntPack) -> Option<LessonObstacle> {
        self.charge.lesson_obstacle(&self.model(settings, learnt))
    }

    /// See [`crate::BatteryMonitor::explain`].
    pub fn explain<'a>(
        &'a self,
        settings: &PackSettings,
        learnt: &'a LearntPack,
    ) -> (&'static str, impl Iterator<Item = Quantity> + 'a) {
        let model = self.model(settings, learnt);
        (self.charge.method(), self.charge.explain(model))
    }

    fn report(&mut self) {
        let estimate = self.charge.estimate();
        self.reported = estimate.and_then(|estimate| ReportedCharge::of(estimate, self.reported.as_ref()));
    }

    fn model<'a>(&self, settings: &PackSettings, learnt: &'a LearntPack) -> CellModel<'a> {
        let cell_count = self.cell_count(settings);
        CellModel {
            chemistry: settings.chemistry,
            cell: settings.chemistry.cell(),
            cell_count,
            rated_ah: settings
                .capacity_mah
                .map(|capacity_mah| capacity_mah * AH_PER_MAH),
            measured_ohm: self.cell_resistance_ohm(settings),
            end: EndVoltage::new(settings, cell_count),
            soc_at_most: 1.0,
            measured: measured_offsets(settings),
            learnt,
        }
    }

    /// Cells in series, as set, else as detected.
    pub fn cell_count(&self, settings: &PackSettings) -> Option<u8> {
        settings.cell_count.or(self.cells.cells())
    }

    /// Whether the detected cells may be fewer than there are.
    pub fn cells_are_doubtful(&self) -> bool {
        self.cells_are_doubtful
    }

    /// The pack's resistance, once measured.
    pub fn resistance_ohm(&self) -> Option<f32> {
        self.resistance.resistance_ohm()
    }

    /// Resistance of a cell, in ohms, once it is known.
    pub fn cell_resistance_ohm(&self, settings: &PackSettings) -> Option<f32> {
        Some(self.resistance_ohm()? / f32::from(self.cell_count(settings)?))
    }

    /// The voltage without load, once the resistance is measured.
    pub fn resting_voltage_v(&self, voltage_v: f32, current_a: f32) -> Option<f32> {
        Some(voltage_v + current_a * self.resistance.resistance_ohm()?)
    }

    /// The estimate of the charge, if it is certain enough.
    pub fn charge(&self) -> Option<&ChargeEstimate> {
        self.reported.and(self.charge.estimate())
    }

    /// The estimate as it is reported, if it is certain enough.
    pub fn reported(&self) -> Option<&ReportedCharge> {
        self.charge.estimate().and(self.reported.as_ref())
    }

    /// The average load, in amperes.
    pub fn average_current_a(&self) -> Option<f32> {
        self.average_current.value()
    }

    /// Seconds until the average load has drawn this share (0 to 1) of a pack with this capacity.
    pub fn time_to_draw_s(&self, soc: f32, capacity_mah: f32) -> Option<f32> {
        let average_a = self.average_current.value()?;
        let drive_a = self.drive_current.value();
        let load_a = drive_a.map_or(average_a, |drive_a| drive_a.max(average_a / MAX_TO_LAST_MINUTE));
        (load_a > MIN_AVERAGE_LOAD_A).then(|| soc * capacity_mah * AH_PER_MAH / load_a * SECONDS_PER_HOUR)
    }

    /// Seconds until the pack can't serve its load any more, where the current is not measured.
    pub fn inferred_time_remaining_s(&self) -> Option<f32> {
        let charge = self.charge()?;
        Some(charge.available / charge.rate_per_h? * SECONDS_PER_HOUR)
    }

    /// The part to retain over a reset.
    pub fn memory(&self) -> EstimatorMemory {
        EstimatorMemory {
            charge: self.charge.known(),
            reference: self.charge.reference(),
            estimated_for: self.estimated_for,
            detected_cells: self.cells.cells(),
            least_cells: self.cells.least(),
        }
    }

    /// Continues with what was retained over a reset. With other cells set the first reading drops it.
    pub fn restore(&mut self, memory: &EstimatorMemory, doubt: Doubt) {
        if let Some(charge) = memory.charge {
            self.set_known(charge);
            if let Some(reference) = memory.reference {
                self.charge.restore(reference, doubt);
            }
        }
        self.cells.restore(memory.detected_cells, memory.least_cells);
        self.estimated_for = memory.estimated_for;
    }

    /// Sets the state of charge, from 0 to 1, on a battery reset; ignored while the cells are in doubt.
    pub fn set_state_of_charge(&mut self, soc: f32) {
        if !self.cells_are_doubtful {
            self.set_known(KnownCharge::set(soc));
        }
    }

    /// The owner says that this is another pack.
    pub fn change_pack(&mut self) {
        self.charge.change_pack();
    }

    /// Whether the sensor takes a load for charging: its current is negative, and its steps those of a load.
    pub fn is_current_reversed(&self) -> bool {
        let is_charging = |average_a| average_a < -RESTING_CURRENT_A;
        self.resistance.is_reversed() && self.average_current_a().is_some_and(is_charging)
    }

    /// The current of a pack, of which `learnt` is known, is lost.
    pub fn lose_current(&mut self, settings: &PackSettings, learnt: &LearntPack) {
        self.charge.lose_current(&self.model(settings, learnt));
    }

    /// The current is made of another source.
    pub fn change_current(&mut self) {
        self.charge.change_current();
    }

    /// The current had another sign.
    pub fn clear_current(&mut self) {
        self.resistance = ResistanceEstimator::new();
        self.average_current = MeanThenLowPass::new(AVERAGE_TIME_CONSTANT_S);
        self.drive_current = NOT_DRIVEN;
    }

    /// Estimates the charge from the voltage once more.
    pub fn restart_charge(&mut self) {
        self.charge = ChargeEstimator::new();
    }

    /// Discards the observations so far: they must not be learnt.
    pub fn restart_drive(&mut self) {
        self.charge.restart_drive();
    }

    fn set_known(&mut self, charge: KnownCharge) {
        self.charge = ChargeEstimator::from_known(charge);
        self.report();
    }
}
