//! Faults that are found in a pack.

use crate::basis::Basis;
use crate::charge::measured_height_v;
use crate::chemistry::{Cell, Chemistry};
use crate::failsafe::is_below;
use crate::reported::Faults;
use crate::settings::PackSettings;
use crate::{BatteryState, ChargeSource};

/// Debounce time of a fault's beginning and end, in seconds.
const DEBOUNCE_S: f32 = 1.0;

/// A contradicted charge has to be so for this long at rest, in seconds: cells recover from a load.
const CONTRADICTION_S: f32 = 10.0;

/// The load is limited as far as it can be for this long before an overload is one, in seconds.
const OVERLOAD_S: f32 = 3.0;

/// Largest difference between the resting voltages of a sum's packs, relative to the lowest.
const MAX_SPREAD: f32 = 0.05;

/// Difference between resting cells that is worth knowing, in volts.
const NOTED_IMBALANCE_V: f32 = 0.2;

/// Faults that last while the temperature is unknown: that of a burning pack may be beyond its thermometer's range.
const OF_TEMPERATURE: Faults = Faults::OVER_TEMPERATURE.union(Faults::UNDER_TEMPERATURE);

/// Maximum difference between the cells of a sound pack, in volts.
const MAX_IMBALANCE_V: f32 = 0.3;

/// Discharge temperature range of lithium cells by most data sheets, in degrees Celsius.
const MIN_TEMPERATURE_C: f32 = -20.0;
const MAX_TEMPERATURE_C: f32 = 60.0;

/// All faults.
pub const FAULTS: [Faults; 11] = [
    Faults::DEEP_DISCHARGE,
    Faults::SPIKES,
    Faults::CELL_FAIL,
    Faults::CELL_DIFFERS,
    Faults::OVER_CURRENT,
    Faults::OVER_TEMPERATURE,
    Faults::UNDER_TEMPERATURE,
    Faults::INCOMPATIBLE_VOLTAGE,
    Faults::CELLS_CONFIGURATION,
    Faults::CONTRADICTED_CHARGE,
    Faults::UNDERSTATED_CHARGE,
];

/// The faults of one pack, debounced.
#[derive(Clone, Copy, Debug, Default)]
pub struct Diagnosis {
    faults: Faults,
    changing_s: [f32; FAULTS.len()],
    /// Kind and number of the cells that the voltage was within the limit of.
    fitting: Option<(Chemistry, u8)>,
}

impl Diagnosis {
    /// No pack is connected: what its voltage and current have shown has ended. Returns the faults that are left.
    pub fn disconnect(&mut self, state: &BatteryState) -> Faults {
        *self = Self {
            faults: self.faults & temperature_conditions(state, self.faults),
            ..Self::default()
        };
        self.faults
    }

    /// Nothing measures the temperature any more.
    pub fn forget_temperature(&mut self) {
        self.faults.remove(OF_TEMPERATURE);
    }

    /// Whether the pack was too hot when its temperature was known last.
    pub fn is_too_hot(&self) -> bool {
        self.faults.contains(Faults::OVER_TEMPERATURE)
    }

    /// Continues with a pack that was too hot.
    pub fn restore_too_hot(&mut self) {
        self.faults.insert(Faults::OVER_TEMPERATURE);
    }

    /// Updates the faults of a connected pack from its other values.
    pub fn update(&mut self, basis: &Basis, state: &BatteryState, settings: &PackSettings) -> Faults {
        let mut present = conditions(state, settings);
        let contradiction = contradiction(basis.resting_v, state, settings);
        present |= temperature_conditions(state, self.faults);
        // As of the others below, until the next rest nothing is known.
        present |= contradiction.unwrap_or(self.faults & Faults::CONTRADICTIONS);
        for (fault, is_present) in [
            (
                Faults::INCOMPATIBLE_VOLTAGE,
                basis.members_spread.map(|spread| spread > MAX_SPREAD),
            ),
            (
                Faults::CELL_DIFFERS,
                basis
                    .resting_v
                    .and(state.cells.imbalance_v())
                    .map(|imbalance_v| imbalance_v > NOTED_IMBALANCE_V && imbalance_v <= MAX_IMBALANCE_V),
            ),
        ] {
            // Until the next rest nothing is known.
            present.set(fault, is_present.unwrap_or(self.faults.contains(fault)));
        }
        let cells = state.cell_count.map(|count| (settings.chemistry, count));
        if !present.contains(Faults::SPIKES) {
            self.fitting = cells;
        } else if self.fitting != cells {
            // No spike but other cells than set, if it lasts.
            present.remove(Faults::SPIKES);
        }
        if present == self.faults {
            self.changing_s = [0.0; FAULTS.len()];
            return present;
        }
        for (fault, changing_s) in FAULTS.into_iter().zip(&mut self.changing_s) {
            if present.contains(fault) == self.faults.contains(fault) {
                *changing_s = 0.0;
                continue;
            }
            *changing_s += basis.dt_s;
            // A spike is shorter than the debounce time.
            let debounce_s = match fault {
                Faults::CONTRADICTED_CHARGE | Faults::UNDERSTATED_CHARGE => CONTRADICTION_S,
                Faults::OVER_CURRENT => OVERLOAD_S,
                _ => DEBOUNCE_S,
            };
            if *changing_s >= debounce_s || (fault == Faults::SPIKES && present.contains(fault)) {
                *changing_s = 0.0;
                self.faults.toggle(fault);
            }
        }
        self.faults
    }
}

fn conditions(state: &BatteryState, settings: &PackSettings) -> Faults {
    let cell = settings.chemistry.cell();
    let mut faults = Faults::empty();
    faults.set(
        Faults::OVER_CURRENT,
        is_below(settings.overload_w, state.power_w()),
    );
    faults.set(
        Faults::CELL_FAIL,
        is_below(Some(MAX_IMBALANCE_V), state.cells.imbalance_v()),
    );
    faults | cell_conditions(state, cell)
}

/// Faults by the temperature; those of `before` while it is unknown.
fn temperature_conditions(state: &BatteryState, before: Faults) -> Faults {
    let Some(temperature_c) = state.pack_temperature_c() else {
        return before & OF_TEMPERATURE;
    };
    let mut faults = Faults::empty();
    faults.set(Faults::OVER_TEMPERATURE, temperature_c > MAX_TEMPERATURE_C);
    faults.set(Faults::UNDER_TEMPERATURE, temperature_c < MIN_TEMPERATURE_C);
    faults
}

/// Faults by cell voltage: of the lowest cell if cells are measured, else of their mean.
fn cell_conditions(state: &BatteryState, cell: &Cell) -> Faults {
    let mut faults = Faults::empty();
    let Some(cell_count) = state.cell_count else {
        return faults;
    };
    let cell_count = f32::from(cell_count);
    let mean_v = |pack_v: Option<f32>| pack_v.map(|pack_v| pack_v / cell_count);
    let resting_v = mean_v(state.resting_or_terminal_voltage_v());
    let max_v = Some(cell.max_v);
    faults.set(Faults::SPIKES, is_below(max_v, mean_v(state.readings.voltage_v)));
    faults.set(
        Faults::CELLS_CONFIGURATION,
        is_below(max_v, resting_v) || is_below(resting_v, Some(cell.min_v)),
    );
    faults.set(
        Faults::DEEP_DISCHARGE,
        is_below(state.cells.lowest_v().or(resting_v), Some(cell.deep_discharge_v)),
    );
    faults
}

/// The fault if a resting cell is lower than any is at the charge that the pack reports, or all are higher; `None` while that is
/// unknown.
fn contradiction(resting_v: Option<f32>, state: &BatteryState, settings: &PackSettings) -> Option<Faults> {
    if state.charge_source == ChargeSource::Estimated {
        return Some(Faults::empty());
    }
    let mean_v = resting_v? / f32::from(state.cell_count?);
    let lowest_v = state.cells.lowest_v().unwrap_or(mean_v);
    let state_of_charge = state.readings.remaining_pct? / 100.0;
    let cell = settings.chemistry.cell();
    let lowest_v = lowest_v - measured_height_v(settings, state_of_charge);
    Some(if lowest_v < cell.lowest_resting_v(state_of_charge) {
        Faults::CONTRADICTED_CHARGE
    } else if lowest_v > cell.highest_resting_v(state_of_charge) {
        Faults::UNDERSTATED_CHARGE
    } else {
        Faults::empty()
    })
}
