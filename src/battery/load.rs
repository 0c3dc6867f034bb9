//! Load of a cell: its rate and voltage sag.

use super::chemistry::Cell;

/// Relative error of a typical resistance.
const TYPICAL_ERROR: f32 = 0.5;

/// Relative error of a measured resistance.
const MEASURED_ERROR: f32 = 0.1;

/// Relative error of the slow part of the sag: it is not measured, and several times larger in the cold.
const SLOW_ERROR: f32 = 1.5;

/// The load of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    /// C rate: current divided by capacity, per hour.
    pub rate_per_h: f32,
    /// Voltage sag, in volts.
    pub sag_v: f32,
    /// Error of the sag, in volts.
    pub sag_error_v: f32,
    /// Source of the capacity.
    pub capacity: CapacitySource,
    /// Source of the resistance.
    pub resistance: ResistanceSource,
}

/// Source of a capacity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CapacitySource {
    /// Set by the owner.
    Set,
    /// Inferred from the resistance.
    Inferred,
}

/// Source of a resistance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ResistanceSource {
    /// Measured from load steps.
    Measured,
    /// Typical of the chemistry and capacity.
    Typical,
}

/// Parameters of a particular cell, as far as known.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellParameters {
    /// In ampere-hours.
    pub capacity_ah: Option<f32>,
    /// In ohms, once measured.
    pub resistance_ohm: Option<f32>,
}

/// A current with its filtered values, in amperes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Currents {
    /// Present value.
    pub now_a: f32,
    /// With the time constant of the voltage it is compared with.
    pub smoothed_a: f32,
    /// With the time constant of the slow sag.
    pub slow_a: f32,
}

impl Load {
    /// The load of a current; `None` while both capacity and resistance are unknown.
    pub fn new(cell: &Cell, parameters: &CellParameters, currents: &Currents) -> Option<Self> {
        let fast_a = currents.smoothed_a;
        let slow_a = currents.slow_a * cell.slow_share;
        let (capacity_ah, capacity) = match (parameters.capacity_ah, parameters.resistance_ohm) {
            (Some(capacity_ah), _) => (capacity_ah, CapacitySource::Set),
            (None, Some(resistance_ohm)) => (cell.ohmic_drop_v / resistance_ohm, CapacitySource::Inferred),
            (None, None) => return None,
        };
        let (resistance_ohm, error_a, resistance) = match parameters.resistance_ohm {
            Some(measured_ohm) => (
                measured_ohm,
                SLOW_ERROR * slow_a + MEASURED_ERROR * fast_a,
                ResistanceSource::Measured,
            ),
            None => (
                cell.ohmic_drop_v / capacity_ah,
                TYPICAL_ERROR * (slow_a + fast_a),
                ResistanceSource::Typical,
            ),
        };
        Some(Self {
            rate_per_h: currents.now_a / capacity_ah,
            sag_v: resistance_ohm * (fast_a + slow_a),
            sag_error_v: resistance_ohm * error_a,
            capacity,
            resistance,
        })
    }
}
