//! Is the voltage plausible?

use super::check::{Check, Outcome, not_measured, outcome};
use crate::board_check::evidence::{Evidence, mean};
use crate::sensor::ADC_REFERENCE_V;

/// A pack that reads this share of full scale, 3.3 V behind the divider, is beyond it.
const END_OF_SCALE: f32 = 0.99;

/// Values of `BATT_MONITOR` with which the board's converter measures the voltage.
const ANALOG_KINDS: [f32; 2] = [3.0, 4.0];

/// Per cell, of any chemistry.
const LOWEST_CELL_V: f32 = 0.9;
const HIGHEST_CELL_V: f32 = 4.4;

pub(super) const CHECK: Check = Check {
    name: "voltage",
    measures: "the first pack's mean voltage",
    expected: "below the converter's end (3.3 V × `BATT_VOLT_MULT`), and 0.9 to 4.4 V a cell if `BATT_CELLS` is set",
    advice: "Set `BATT_CELLS` and `BATT_VOLT_PIN`; measure the pack with a multimeter and run with `--multimeter`.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let Some(mean_v) = mean(&evidence.voltages_v()) else {
        return not_measured("no pack is connected");
    };
    let is_analog = evidence
        .parameter("BATT_MONITOR")
        .is_some_and(|kind| ANALOG_KINDS.contains(&kind));
    let multiplier = evidence.parameter("BATT_VOLT_MULT").filter(|_| is_analog);
    let is_at_end =
        multiplier.is_some_and(|multiplier| mean_v >= END_OF_SCALE * ADC_REFERENCE_V * multiplier);
    let cells = evidence.parameter("BATT_CELLS").filter(|cells| *cells > 0.0);
    let cell_v = cells.map(|cells| mean_v / cells);
    let against = if is_at_end {
        Some("The voltage is at the end of the converter's range.")
    } else {
        let is_off = cell_v.is_some_and(|cell_v| !(LOWEST_CELL_V..=HIGHEST_CELL_V).contains(&cell_v));
        is_off.then_some("The voltage does not fit the number of cells.")
    };
    let of_cell = cell_v.map_or("cells not set".into(), |cell_v| format!("{cell_v:.2} V a cell"));
    outcome(format!("{mean_v:.2} V, {of_cell}"), against)
}
