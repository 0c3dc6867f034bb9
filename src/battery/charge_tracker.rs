//! Initialises the state of charge from the voltage, and tracks it.

use super::ArmState;
use super::charge::{CellReading, FilterGains, StateOfCharge};
use super::chemistry::Cell;
use super::load::{Load, ResistanceSource};

/// After a longer gap between readings the estimate is initialised again, in seconds.
const MAX_GAP_S: f32 = 60.0;

/// While armed without a current sensor, the maximum voltage within this time counts as the resting one, in seconds.
const PEAK_HOLD_S: f32 = 30.0;

/// An estimate that was initialised under load is averaged for this long, in seconds: over changing loads the errors of
/// the sag partly cancel.
const SETTLING_S: f32 = 60.0;

/// Time constant with which the voltage tightens the bounds, in seconds: noise must not tighten them.
const BOUND_TIME_CONSTANT_S: f32 = 10.0;

/// The same after a battery reset.
const RESET_TIME_CONSTANT_S: f32 = 600.0;

/// Tracks the state of charge of one pack.
#[derive(Clone, Copy, Debug)]
pub(super) enum ChargeTracker {
    /// Waits for a voltage that counts as a resting one.
    Waiting {
        /// In seconds.
        waited_s: f32,
        /// The maximum cell voltage so far, in volts.
        highest_v: f32,
    },
    /// Initialised.
    Tracking {
        /// The estimate.
        charge: StateOfCharge,
        /// How it was initialised.
        start: Start,
        /// The gains of its corrections.
        gains: FilterGains,
    },
}

/// How an estimate was initialised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Start {
    /// From a known voltage and sag, or settled since.
    Final,
    /// Under a load with an uncertain sag: the running mean of the estimates since then.
    Settling {
        /// Seconds since the start.
        elapsed_s: f32,
        /// The source of the resistance; once it is measured, the estimate is initialised again.
        resistance: ResistanceSource,
    },
    /// Set by a battery reset: a voltage that contradicts it corrects it slowly.
    FromReset,
}

impl ChargeTracker {
    pub const fn new() -> Self {
        Self::Waiting {
            waited_s: 0.0,
            highest_v: 0.0,
        }
    }

    /// Set by a battery reset, from 0 to 1.
    pub const fn from_reset(share: f32) -> Self {
        Self::track(StateOfCharge::from_reset(share), Start::FromReset)
    }

    const fn track(charge: StateOfCharge, start: Start) -> Self {
        let bound_time_constant_s = match start {
            Start::Final | Start::Settling { .. } => BOUND_TIME_CONSTANT_S,
            Start::FromReset => RESET_TIME_CONSTANT_S,
        };
        Self::Tracking {
            charge,
            start,
            gains: FilterGains::new(bound_time_constant_s),
        }
    }

    /// The estimate, once initialised.
    pub fn charge(&self) -> Option<&StateOfCharge> {
        match self {
            Self::Waiting { .. } => None,
            Self::Tracking { charge, .. } => Some(charge),
        }
    }

    pub fn update(&mut self, cell: &Cell, reading: &CellReading) {
        if reading.dt_s > MAX_GAP_S || self.can_reinitialise(reading.load) {
            *self = Self::new();
        }
        match self {
            Self::Waiting { waited_s, highest_v } => {
                *waited_s += reading.dt_s;
                *highest_v = highest_v.max(reading.voltage_v.unwrap_or(0.0));
                let (waited_s, highest_v) = (*waited_s, *highest_v);
                if reading.voltage_v.is_some() {
                    self.try_initialise(cell, reading, waited_s, highest_v);
                }
            }
            Self::Tracking { charge, start, gains } => {
                charge.update(cell, reading, gains);
                start.settle(charge, cell, reading);
            }
        }
    }

    fn can_reinitialise(&self, load: Option<Load>) -> bool {
        let resistance_was_typical = matches!(
            self,
            Self::Tracking {
                start: Start::Settling {
                    resistance: ResistanceSource::Typical,
                    ..
                },
                ..
            }
        );
        resistance_was_typical && load.is_some_and(|load| load.resistance == ResistanceSource::Measured)
    }

    fn try_initialise(&mut self, cell: &Cell, reading: &CellReading, waited_s: f32, highest_v: f32) {
        let (voltage_v, start) = match (reading.load, reading.voltage_v) {
            (Some(load), Some(voltage_v)) => (voltage_v, Start::under(&load, cell)),
            _ if reading.arm_state == ArmState::Disarmed || waited_s >= PEAK_HOLD_S => {
                (highest_v, Start::Final)
            }
            _ => return,
        };
        *self = Self::track(StateOfCharge::from_voltage(cell, voltage_v, reading.load), start);
    }
}

impl From<StateOfCharge> for ChargeTracker {
    fn from(charge: StateOfCharge) -> Self {
        Self::track(charge, Start::Final)
    }
}

impl Start {
    fn under(load: &Load, cell: &Cell) -> Self {
        if load.sag_error_v.abs() <= cell.curve_spread_v {
            return Self::Final;
        }
        Self::Settling {
            elapsed_s: 0.0,
            resistance: load.resistance,
        }
    }

    fn settle(&mut self, charge: &mut StateOfCharge, cell: &Cell, reading: &CellReading) {
        let Self::Settling { elapsed_s, .. } = self else {
            return;
        };
        *elapsed_s += reading.dt_s;
        if *elapsed_s > SETTLING_S {
            *self = Self::Final;
        } else if let (Some(load), Some(voltage_v)) = (reading.load, reading.voltage_v)
            && *elapsed_s > 0.0
        {
            charge.correct(cell, voltage_v, load, reading.dt_s / *elapsed_s);
        }
    }
}
