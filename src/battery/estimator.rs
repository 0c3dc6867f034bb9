//! What can't be measured: resistance, resting voltage, cells, state of charge, time left.

use super::Chemistry;
use super::cell_count::CellCount;
use super::charge::StateOfCharge;
use super::charge_tracker::{CellReading, ChargeTracker};
use super::event::PackEvent;
use super::failsafe::ArmState;
use super::load::{Currents, KnownOfCell, Load};
use super::low_pass::{LowPass, WarmingLowPass};
use super::resistance::ResistanceEstimator;
use super::rest::RESTING_CURRENT_A;
use super::settings::PackSettings;

/// Voltage and current are compared with the curve as means over about this long: sensors that read one a little later
/// than the other, and cells that answer a little later, cancel out.
const SMOOTHING_TIME_CONSTANT_S: f32 = 3.0;

/// The slow part of the sag builds up and relaxes within about this time.
const SLOW_SAG_TIME_CONSTANT_S: f32 = 300.0;

/// The load is averaged over about this long for the time that is left.
const AVERAGE_TIME_CONSTANT_S: f32 = 60.0;

/// A smaller load leaves more time than anybody plans with, in amperes.
const SMALLEST_LOAD_A: f32 = 0.01;

const AH_PER_MAH: f32 = 0.001;
const SECONDS_PER_HOUR: f32 = 3600.0;

/// Readings of a connected pack.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// Seconds since the reading before.
    pub dt_s: f32,
    pub voltage_v: Option<f32>,
    pub current_a: Option<f32>,
    pub arm_state: ArmState,
}

/// Estimates of one pack.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimator {
    resistance: ResistanceEstimator,
    cells: CellCount,
    voltage: LowPass,
    current: LowPass,
    slow_current: WarmingLowPass,
    average_current: WarmingLowPass,
    charge: ChargeTracker,
    /// What the cells were taken to be, and their number as far as it was set.
    estimated_for: Option<(Chemistry, Option<u8>)>,
}

impl Estimator {
    pub const fn new() -> Self {
        Self {
            resistance: ResistanceEstimator::new(),
            cells: CellCount::new(),
            voltage: LowPass::new(SMOOTHING_TIME_CONSTANT_S),
            current: LowPass::new(SMOOTHING_TIME_CONSTANT_S),
            slow_current: WarmingLowPass::new(SLOW_SAG_TIME_CONSTANT_S),
            average_current: WarmingLowPass::new(AVERAGE_TIME_CONSTANT_S),
            charge: ChargeTracker::new(),
            estimated_for: None,
        }
    }

    /// Takes a reading, and tells if it shows how many cells there are, or that it can't be told.
    pub fn update(&mut self, reading: &Reading, settings: &PackSettings) -> Option<PackEvent> {
        if let Some(voltage_v) = reading.voltage_v {
            self.voltage.update(reading.dt_s, voltage_v);
        }
        if let Some(current_a) = reading.current_a {
            self.follow_current(reading.dt_s, current_a);
        }
        if let (Some(voltage_v), Some(current_a)) = (reading.voltage_v, reading.current_a) {
            self.resistance.update(reading.dt_s, voltage_v, current_a);
        }
        let event = self.detect_cells(reading, settings);
        self.follow_charge(reading, settings);
        event
    }

    fn follow_current(&mut self, dt_s: f32, current_a: f32) {
        self.current.update(dt_s, current_a);
        if self.slow_current.value().is_none() && current_a.abs() <= RESTING_CURRENT_A {
            // A pack that is found at rest has rested. One that is found under load is taken to have been used alike.
            self.slow_current.settle(current_a);
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

    fn follow_charge(&mut self, reading: &Reading, settings: &PackSettings) {
        let cells = (settings.chemistry, settings.cell_count);
        if self
            .estimated_for
            .replace(cells)
            .is_some_and(|before| before != cells)
        {
            // What the owner has corrected makes the estimate so far worthless.
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
        let known = KnownOfCell {
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
            &known,
            &Currents {
                now_a: current_a,
                smoothed_a: self.current.value().unwrap_or(current_a),
                slow_a: self.slow_current.value().unwrap_or(current_a),
            },
        )
    }

    /// Cells in series, as set or else as detected.
    pub fn cell_count(&self, settings: &PackSettings) -> Option<u8> {
        settings.cell_count.or(self.cells.found())
    }

    /// The pack's resistance, once it was learnt.
    pub fn resistance_ohm(&self) -> Option<f32> {
        self.resistance.resistance_ohm()
    }

    /// The voltage without the load, once the resistance was learnt.
    pub fn resting_voltage_v(&self, voltage_v: f32, current_a: f32) -> Option<f32> {
        Some(voltage_v + current_a * self.resistance.resistance_ohm()?)
    }

    /// 0 empty, 1 full.
    pub fn state_of_charge(&self) -> Option<f32> {
        self.charge.charge().and_then(StateOfCharge::value)
    }

    /// The average load, in amperes.
    pub fn average_current_a(&self) -> Option<f32> {
        self.average_current.value()
    }

    /// Seconds until the pack, which is full from 0 to 1, is empty at the average load.
    pub fn time_remaining_s(&self, share: f32, settings: &PackSettings) -> Option<f32> {
        let charge_ah = share * settings.capacity_mah? * AH_PER_MAH;
        let average_a = self
            .average_current
            .value()
            .filter(|average_a| *average_a > SMALLEST_LOAD_A)?;
        Some(charge_ah / average_a * SECONDS_PER_HOUR)
    }

    /// What has to survive a reset: the state of charge and the cells that were detected.
    pub fn memory(&self) -> (Option<StateOfCharge>, Option<u8>) {
        (self.charge.charge().copied(), self.cells.found())
    }

    /// Takes up what was known before a reset.
    pub fn restore(&mut self, charge: Option<StateOfCharge>, detected_cells: Option<u8>) {
        if let Some(charge) = charge {
            self.charge = ChargeTracker::from(charge);
        }
        if let Some(count) = detected_cells {
            self.cells.restore(count);
        }
    }

    /// Somebody who knows has told how full the pack is, from 0 to 1.
    pub fn set_state_of_charge(&mut self, share: f32) {
        self.charge = ChargeTracker::told(share);
    }
}
