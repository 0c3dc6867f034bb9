//! How urgently a pack needs attention.

use super::{BatteryState, ChargeState, FailsafeLevel};
use crate::vehicle::BatteryAlert;

/// What lamps and buzzer show of a pack in this state.
pub(super) fn alert_of(state: &BatteryState) -> BatteryAlert {
    let by_failsafe = match state.failsafe {
        FailsafeLevel::None => BatteryAlert::None,
        FailsafeLevel::Unhealthy | FailsafeLevel::Low => BatteryAlert::Warning,
        FailsafeLevel::Critical => BatteryAlert::Urgent,
    };
    let by_charge = match state.charge_state {
        ChargeState::Critical | ChargeState::Emergency | ChargeState::Failed => BatteryAlert::Urgent,
        _ if state.has_failed() => BatteryAlert::Urgent,
        ChargeState::Low => BatteryAlert::Warning,
        _ if !state.faults.is_empty() => BatteryAlert::Warning,
        ChargeState::Charging => BatteryAlert::Charging,
        ChargeState::Undefined | ChargeState::Ok | ChargeState::Unhealthy => BatteryAlert::None,
    };
    by_failsafe.max(by_charge)
}
