//! Estimates of a pack: resistance, resting voltage, cell count, state of charge, remaining time.

use super::cell_count::CellCount;
use super::charge::{CellReading, StateOfCharge};
use super::charge_tracker::ChargeTracker;
use super::event::PackEvent;
use super::load::{CellParameters, Currents, Load};
use super::low_pass::{LowPass, MeanThenLowPass};
use super::resistance::ResistanceEstimator;
use super::rest::RESTING_CURRENT_A;
use super::settings::PackSettings;
use super::{ArmState, Chemistry};

/// Time constant of voltage and current before they are compared with the curve, in seconds: it hides a delay between
/// the two sensors, and that of the cells.
const SMOOTHING_TIME_CONSTANT_S: f32 = 3.0;

/// Time constant of the slow part of the sag, in seconds.
const SLOW_SAG_TIME_CONSTANT_S: f32 = 300.0;

/// Time constant of the average load, which gives the remaining time, in seconds.
const AVERAGE_TIME_CONSTANT_S: f32 = 60.0;

/// Below this average load the remaining time is not reported, in amperes.
const MIN_AVERAGE_LOAD_A: f32 = 0.01;

const AH_PER_MAH: f32 = 0.001;
const SECONDS_PER_HOUR: f32 = 3600.0;

/// A reading of a connected pack.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// Seconds since the previous reading.
    pub dt_s: f32,
    pub voltage_v: Option<f32>,
    pub current_a: Option<f32>,
    pub arm_state: ArmState,
}

/// The estimators of one pack.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimator {
    resistance: ResistanceEstimator,
    cells: CellCount,
    voltage: LowPass,
    current: LowPass,
    slow_current: MeanThenLowPass,
    average_current: MeanThenLowPass,
    charge: ChargeTracker,
    /// The chemistry and cell count setting of the present estimate.
    estimated_for: Option<(Chemistry, Option<u8>)>,
}

impl Estimator {
    pub const fn new() -> Self {
        Self {
            resistance: ResistanceEstimator::new(),
            cells: CellCount::new(),
            voltage: LowPass::new(SMOOTHING_TIME_CONSTANT_S),
            current: LowPass::new(SMOOTHING_TIME_CONSTANT_S),
            slow_current: MeanThenLowPass::new(SLOW_SAG_TIME_CONSTANT_S),
            average_current: MeanThenLowPass::new(AVERAGE_TIME_CONSTANT_S),
            charge: ChargeTracker::new(),
            estimated_for: None,
        }
    }

    /// Processes a reading. Returns an event when cell detection ends.
    pub fn update(&mut self, reading: &Reading, settings: &PackSettings) -> Option<PackEvent> {
        if let Some(voltage_v) = reading.voltage_v {
            self.voltage.update(reading.dt_s, voltage_v);
        }
        if let Some(current_a) = reading.current_a {
            self.update_current(reading.dt_s, current_a);
        }
        if let (Some(voltage_v), Some(current_a)) = (reading.voltage_v, reading.current_a) {
            self.resistance.update(reading.dt_s, voltage_v, current_a);
        }
        let event = self.detect_cells(reading, settings);
        self.update_charge(reading, settings);
        event
    }

    fn update_current(&mut self, dt_s: f32, current_a: f32) {
        self.current.update(dt_s, current_a);
        if self.slow_current.value().is_none() && current_a.abs() <= RESTING_CURRENT_A {
            // First seen at rest, the pack is assumed to have rested; under load, to have had that load.
            self.slow_current.initialise(current_a);
        }
        self.slow_current.update(dt_s, current_a);
        self.average_current.update(dt_s, current_a);
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
        )
    }

    fn update_charge(&mut self, reading: &Reading, settings: &PackSettings) {
        let cells = (settings.chemistry, settings.cell_count);
        if self
            .estimated_for
            .replace(cells)
            .is_some_and(|before| before != cells)
        {
            // The estimate so far was made with wrong settings.
            self.charge = ChargeTracker::new();
        }
        let cell_reading = self.cell_reading(reading, settings);
        self.charge.update(settings.chemistry.cell(), &cell_reading);
    }

    fn cell_reading(&self, reading: &Reading, settings: &PackSettings) -> CellReading {
        let cell_count = self.cell_count(settings).map(f32::from);
        let pack_v = self.voltage.value().filter(|_| reading.voltage_v.is_some());
        CellReading {
            dt_s: reading.dt_s,
            voltage_v: pack_v.zip(cell_count).map(|(pack_v, count)| pack_v / count),
            load: reading
                .current_a
                .and_then(|current_a| self.load(current_a, settings)),
            arm_state: reading.arm_state,
        }
    }

    fn load(&self, current_a: f32, settings: &PackSettings) -> Option<Load> {
        let cell_count = self.cell_count(settings).map(f32::from);
        let parameters = CellParameters {
            capacity_ah: settings
                .capacity_mah
                .map(|capacity_mah| capacity_mah * AH_PER_MAH),
            resistance_ohm: self
                .resistance_ohm()
                .zip(cell_count)
                .map(|(pack_ohm, count)| pack_ohm / count),
        };
        Load::new(
            settings.chemistry.cell(),
            &parameters,
            &Currents {
                now_a: current_a,
                smoothed_a: self.current.value().unwrap_or(current_a),
                slow_a: self.slow_current.value().unwrap_or(current_a),
            },
        )
    }

    /// Cells in series, as set, else as detected.
    pub fn cell_count(&self, settings: &PackSettings) -> Option<u8> {
        settings.cell_count.or(self.cells.cells())
    }

    /// The pack's resistance, once measured.
    pub fn resistance_ohm(&self) -> Option<f32> {
        self.resistance.resistance_ohm()
    }

    /// The voltage without load, once the resistance is measured.
    pub fn resting_voltage_v(&self, voltage_v: f32, current_a: f32) -> Option<f32> {
        Some(voltage_v + current_a * self.resistance.resistance_ohm()?)
    }

    /// State of charge, from 0 to 1.
    pub fn state_of_charge(&self) -> Option<f32> {
        self.charge.charge().and_then(StateOfCharge::value)
    }

    /// Upper bound of a state of charge that is known, from 0 to 1.
    pub fn state_of_charge_at_most(&self) -> Option<f32> {
        self.charge.charge().and_then(StateOfCharge::at_most)
    }

    /// The average load, in amperes.
    pub fn average_current_a(&self) -> Option<f32> {
        self.average_current.value()
    }

    /// Seconds until a pack with this state of charge (0 to 1) is empty at the average load.
    pub fn time_remaining_s(&self, state_of_charge: f32, settings: &PackSettings) -> Option<f32> {
        let charge_ah = state_of_charge * settings.capacity_mah? * AH_PER_MAH;
        let average_a = self
            .average_current
            .value()
            .filter(|average_a| *average_a > MIN_AVERAGE_LOAD_A)?;
        Some(charge_ah / average_a * SECONDS_PER_HOUR)
    }

    /// What is retained over a reset: state of charge and detected cell count.
    pub fn memory(&self) -> (Option<StateOfCharge>, Option<u8>) {
        (self.charge.charge().copied(), self.cells.cells())
    }

    /// Continues with what was retained over a reset.
    pub fn restore(&mut self, charge: Option<StateOfCharge>, detected_cells: Option<u8>) {
        if let Some(charge) = charge {
            self.charge = ChargeTracker::from(charge);
        }
        if let Some(count) = detected_cells {
            self.cells.restore(count);
        }
    }

    /// Sets the state of charge, from 0 to 1, on a battery reset.
    pub fn set_state_of_charge(&mut self, share: f32) {
        self.charge = ChargeTracker::from_reset(share);
    }
}
