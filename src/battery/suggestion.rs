//! Thresholds that suit a pack whose owner has set none.

use super::{BatteryState, PackSettings, Thresholds};

/// Usual voltages under a moderate load for `BATT_LOW_VOLT` and `BATT_CRT_VOLT`, in volts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuggestedThresholds {
    /// For `BATT_LOW_VOLT`.
    pub low_v: f32,
    /// For `BATT_CRT_VOLT`.
    pub critical_v: f32,
}

impl SuggestedThresholds {
    /// For a pack whose number of cells is known and which has no threshold.
    pub fn of(state: &BatteryState, settings: &PackSettings) -> Option<Self> {
        let none = Thresholds::default();
        if settings.failsafe.low != none || settings.failsafe.critical != none {
            return None;
        }
        let cells = f32::from(state.cell_count?);
        let cell = state.chemistry.cell();
        Some(Self {
            low_v: cell.low_v * cells,
            critical_v: cell.critical_v * cells,
        })
    }
}
