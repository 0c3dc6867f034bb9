//! How urgently a pack needs attention.

use super::{BatteryState, ChargeState, FailsafeLevel};

/// How urgently a pack needs attention, for lamps and buzzer, in increasing urgency.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum BatteryAlert {
    /// Not at all.
    #[default]
    None,
    /// It is being charged.
    Charging,
    /// It is low, has a fault, or its sensor has failed while armed.
    Warning,
    /// It is critical, nearly empty, or has failed.
    Urgent,
}

impl BatteryAlert {
    pub(super) fn of(state: &BatteryState) -> Self {
        let by_failsafe = match state.failsafe {
            FailsafeLevel::None => Self::None,
            FailsafeLevel::Unhealthy | FailsafeLevel::Low => Self::Warning,
            FailsafeLevel::Critical => Self::Urgent,
        };
        let by_charge = match state.charge_state {
            ChargeState::Critical | ChargeState::Emergency | ChargeState::Failed => Self::Urgent,
            _ if state.has_failed() => Self::Urgent,
            ChargeState::Low => Self::Warning,
            _ if !state.faults.is_empty() => Self::Warning,
            ChargeState::Charging => Self::Charging,
            ChargeState::Undefined | ChargeState::Ok | ChargeState::Unhealthy => Self::None,
        };
        by_failsafe.max(by_charge)
    }
}
