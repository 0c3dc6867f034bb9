//! From the first voltage on: follows the state of charge.

use super::charge::{Paces, StateOfCharge};
use super::chemistry::Cell;
use super::failsafe::ArmState;
use super::load::{Load, ResistanceSource};

/// After a longer pause the charge is estimated afresh, in seconds.
const LONGEST_PAUSE_S: f32 = 60.0;

/// While an armed rover's load is not measured, the highest voltage in so many seconds is taken for the resting one.
const WAIT_FOR_REST_S: f32 = 30.0;

/// An estimate that began under load is averaged for so long, in seconds: over changing loads the errors of the sag cancel
/// out in part.
const SETTLING_S: f32 = 60.0;

/// How fast bounds that the voltage tells are taken over, in seconds: noise must not narrow them.
const BOUND_TIME_CONSTANT_S: f32 = 10.0;

/// The same after a battery reset.
const TOLD_TIME_CONSTANT_S: f32 = 600.0;

/// A reading of one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellReading {
    /// Seconds since the reading before.
    pub dt_s: f32,
    /// The cell's voltage, in volts, if it is known.
    pub voltage_v: Option<f32>,
    /// The load, if it is known.
    pub load: Option<Load>,
    /// Without a known load: disarmed, the motors are off and the cells rest.
    pub arm_state: ArmState,
}

/// Follows the state of charge of one pack.
#[derive(Clone, Copy, Debug)]
pub(super) enum ChargeTracker {
    /// Waits for a voltage that can be taken for a resting one.
    Waiting {
        /// For how long, in seconds.
        waited_s: f32,
        /// The highest voltage of a cell so far, in volts.
        highest_v: f32,
    },
    /// Knows.
    Following {
        /// What it knows.
        charge: StateOfCharge,
        /// How well it began.
        start: Start,
        /// How fast it gives way.
        paces: Paces,
    },
}

/// How well an estimate began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Start {
    /// It stands.
    Final,
    /// Under a load whose sag is uncertain: it is the mean of what was told for so many seconds.
    Settling {
        /// Since the start.
        elapsed_s: f32,
        /// What the sag was reckoned with; the estimate begins anew once that was learnt.
        resistance: ResistanceSource,
    },
    /// Somebody has told: only slowly does it give way to a voltage that contradicts it.
    Told,
}

impl ChargeTracker {
    pub const fn new() -> Self {
        Self::Waiting {
            waited_s: 0.0,
            highest_v: 0.0,
        }
    }

    /// Somebody has told the state of charge, from 0 to 1.
    pub const fn told(share: f32) -> Self {
        Self::follow(StateOfCharge::told(share), Start::Told)
    }

    const fn follow(charge: StateOfCharge, start: Start) -> Self {
        let bound_time_constant_s = match start {
            Start::Final | Start::Settling { .. } => BOUND_TIME_CONSTANT_S,
            Start::Told => TOLD_TIME_CONSTANT_S,
        };
        Self::Following {
            charge,
            start,
            paces: Paces::new(bound_time_constant_s),
        }
    }

    /// What is known.
    pub fn charge(&self) -> Option<&StateOfCharge> {
        match self {
            Self::Waiting { .. } => None,
            Self::Following { charge, .. } => Some(charge),
        }
    }

    pub fn update(&mut self, cell: &Cell, reading: &CellReading) {
        if reading.dt_s > LONGEST_PAUSE_S || self.can_start_better(reading.load) {
            *self = Self::new();
        }
        match self {
            Self::Waiting { waited_s, highest_v } => {
                *waited_s += reading.dt_s;
                *highest_v = highest_v.max(reading.voltage_v.unwrap_or(0.0));
                let (waited_s, highest_v) = (*waited_s, *highest_v);
                if reading.voltage_v.is_some() {
                    self.try_start(cell, reading, waited_s, highest_v);
                }
            }
            Self::Following { charge, start, paces } => {
                charge.update(cell, reading, paces);
                start.settle(charge, cell, reading);
            }
        }
    }

    fn can_start_better(&self, load: Option<Load>) -> bool {
        let was_guessed = matches!(
            self,
            Self::Following {
                start: Start::Settling {
                    resistance: ResistanceSource::Typical,
                    ..
                },
                ..
            }
        );
        was_guessed && load.is_some_and(|load| load.resistance == ResistanceSource::Learnt)
    }

    fn try_start(&mut self, cell: &Cell, reading: &CellReading, waited_s: f32, highest_v: f32) {
        let (voltage_v, start) = match (reading.load, reading.voltage_v) {
            (Some(load), Some(voltage_v)) => (voltage_v, Start::under(&load, cell)),
            _ if reading.arm_state == ArmState::Disarmed || waited_s >= WAIT_FOR_REST_S => {
                (highest_v, Start::Final)
            }
            _ => return,
        };
        *self = Self::follow(StateOfCharge::from_voltage(cell, voltage_v, reading.load), start);
    }
}

impl From<StateOfCharge> for ChargeTracker {
    fn from(charge: StateOfCharge) -> Self {
        Self::follow(charge, Start::Final)
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
            charge.look_again(cell, voltage_v, load, reading.dt_s / *elapsed_s);
        }
    }
}
