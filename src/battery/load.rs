//! What a current does to a cell.

use super::chemistry::Cell;

/// How far off the resistance may be while it is only what is typical, as a share.
const TYPICAL_UNCERTAINTY: f32 = 0.5;

/// How far off the resistance may be once it was learnt, as a share.
const LEARNT_UNCERTAINTY: f32 = 0.1;

/// How far off the slow part of the sag may be, as a share: it is not learnt, and in the cold it is several times larger.
const SLOW_UNCERTAINTY: f32 = 1.5;

/// What a current does to a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    /// Current divided by capacity, per hour.
    pub rate_per_h: f32,
    /// What the load takes off the cell's voltage, in volts.
    pub sag_v: f32,
    /// How far off that may be, in volts.
    pub sag_error_v: f32,
    /// Where the capacity comes from.
    pub capacity: CapacitySource,
    /// Where the resistance comes from.
    pub resistance: ResistanceSource,
}

/// Where a capacity comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CapacitySource {
    /// The owner has set it.
    Set,
    /// It was guessed from the resistance.
    Guessed,
}

/// Where a resistance comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ResistanceSource {
    /// Load steps have shown it.
    Learnt,
    /// It is typical of such a cell.
    Typical,
}

/// What is known of one cell, besides what is typical.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownOfCell {
    /// In ampere-hours.
    pub capacity_ah: Option<f32>,
    /// In ohms, once it was learnt.
    pub resistance_ohm: Option<f32>,
}

/// A current, in amperes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Currents {
    /// At this moment.
    pub now_a: f32,
    /// Over as long as the voltage it is compared with.
    pub smoothed_a: f32,
    /// Over some minutes.
    pub slow_a: f32,
}

impl Load {
    /// The load of a current; `None` if neither capacity nor resistance is known, for then it may be small or large.
    pub fn new(cell: &Cell, known: &KnownOfCell, currents: &Currents) -> Option<Self> {
        let fast_a = currents.smoothed_a;
        let slow_a = currents.slow_a * cell.slow_share;
        let (capacity_ah, capacity) = match (known.capacity_ah, known.resistance_ohm) {
            (Some(capacity_ah), _) => (capacity_ah, CapacitySource::Set),
            (None, Some(resistance_ohm)) => (cell.ohmic_drop_v / resistance_ohm, CapacitySource::Guessed),
            (None, None) => return None,
        };
        let (resistance_ohm, uncertain_a, resistance) = match known.resistance_ohm {
            Some(learnt_ohm) => (
                learnt_ohm,
                SLOW_UNCERTAINTY * slow_a + LEARNT_UNCERTAINTY * fast_a,
                ResistanceSource::Learnt,
            ),
            None => (
                cell.ohmic_drop_v / capacity_ah,
                TYPICAL_UNCERTAINTY * (slow_a + fast_a),
                ResistanceSource::Typical,
            ),
        };
        Some(Self {
            rate_per_h: currents.now_a / capacity_ah,
            sag_v: resistance_ohm * (fast_a + slow_a),
            sag_error_v: resistance_ohm * uncertain_a,
            capacity,
            resistance,
        })
    }
}
