//! Consequences of each condition of a pack: one table for BATTERY_STATUS_V2, SYS_STATUS and arming.
//!
//! `docs/proof.md` shows it. What is not in it has no consequence.

use core::fmt;

use bitflags::bitflags;

use super::{BatteryState, ChargeState, FailsafeLevel, Faults, Modes, PackStatus};

bitflags! {
    /// Consequences of a condition for ground stations.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Consequences: u8 {
        /// A connected pack is not ready to use.
        const NOT_READY = 1;
        /// The pack, or its sensor, is not healthy.
        const NOT_HEALTHY = 1 << 1;
    }
}

/// Why a pack fails the arming checks, in ArduPilot's words and order where it has the check; but *critical* comes before
/// *low*: an attempt to arm names the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ArmingFailure {
    /// The voltage is above `MOT_DRV_VOLT`, and the pack supplies the motors.
    AboveDrivers,
    /// No pack is connected, its sensor has failed, or an unhealthy failsafe is latched.
    Unhealthy,
    /// Its mask names another sum, which has no part in it.
    SumsASum,
    /// The pack has failed: a cell is broken, or it reports that it has failed or is bad.
    Failed,
    /// The voltage does not fit `BATT_CELLS`: what the charge is computed from is wrong.
    WrongCells,
    /// The voltage is that of fewer cells than the pack had before, or of as many that are deeply discharged.
    UnclearCells,
    /// A cell rests lower than the charge that the pack reports allows.
    ContradictedCharge,
    /// The pack is too hot.
    TooHot,
    /// The pack reports that it is unhealthy.
    ReportsUnhealthy,
    /// The charge state is EMERGENCY, or the pack reports it.
    Emergency,
    /// The terminal voltage is below `BATT_ARM_VOLT`.
    BelowArmingVoltage,
    /// The remaining charge is below `BATT_ARM_MAH`.
    BelowArmingCapacity,
    /// The voltage is below `BATT_CRT_VOLT`, or a critical failsafe is latched.
    CriticalVoltage,
    /// The remaining charge is below `BATT_CRT_MAH`.
    CriticalCapacity,
    /// The voltage is below `BATT_LOW_VOLT`, or a low failsafe is latched.
    LowVoltage,
    /// The remaining charge is below `BATT_LOW_MAH`.
    LowCapacity,
    /// A threshold is set in milliampere-hours, and the capacity is known neither to the owner nor to the pack.
    NoCapacity,
    /// `BATT_CRT_MAH` is not below `BATT_LOW_MAH`.
    CapacityOrder,
    /// `BATT_CRT_VOLT` is not below `BATT_LOW_VOLT`.
    VoltageOrder,
    /// `BATT_CRT_PCT` or `BATT_EMR_PCT` is not below `BATT_LOW_PCT`, and they act.
    PercentageOrder,
    /// The owner's curve falls, has equal points, or is of cells of another chemistry: it is not used.
    CurveOrder,
}

impl fmt::Display for ArmingFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AboveDrivers => "voltage above MOT_DRV_VOLT",
            Self::Unhealthy => "unhealthy",
            Self::SumsASum => "sums another sum",
            Self::Failed => "has failed",
            Self::WrongCells => "voltage does not fit cells",
            Self::UnclearCells => "cells unclear",
            Self::ContradictedCharge => "charge contradicts voltage",
            Self::TooHot => "over temperature",
            Self::ReportsUnhealthy => "unhealthy: its own report",
            Self::Emergency => "is nearly empty",
            Self::BelowArmingVoltage => "below minimum arming voltage",
            Self::BelowArmingCapacity => "below minimum arming capacity",
            Self::LowVoltage => "low voltage failsafe",
            Self::LowCapacity => "low capacity failsafe",
            Self::CriticalVoltage => "critical voltage failsafe",
            Self::CriticalCapacity => "critical capacity failsafe",
            Self::NoCapacity => "no capacity set",
            Self::CapacityOrder => "capacity failsafe critical >= low",
            Self::VoltageOrder => "voltage failsafe critical >= low",
            Self::PercentageOrder => "percentage failsafe critical >= low",
            Self::CurveOrder => "curve does not rise, or fit its cells",
        })
    }
}

impl ArmingFailure {
    /// All, in the order in which they are reported.
    pub(super) const ALL: [Self; 21] = [
        // First: at full scale the pack is unhealthy, too.
        Self::AboveDrivers,
        Self::Unhealthy,
        Self::SumsASum,
        Self::Failed,
        Self::WrongCells,
        Self::UnclearCells,
        Self::ContradictedCharge,
        Self::TooHot,
        Self::ReportsUnhealthy,
        Self::Emergency,
        Self::BelowArmingVoltage,
        Self::BelowArmingCapacity,
        Self::CriticalVoltage,
        Self::CriticalCapacity,
        Self::LowVoltage,
        Self::LowCapacity,
        Self::NoCapacity,
        Self::CapacityOrder,
        Self::VoltageOrder,
        Self::PercentageOrder,
        Self::CurveOrder,
    ];

    pub(super) fn bit(self) -> u32 {
        1 << self as u8
    }
}

/// A condition, by its origin.
#[derive(Clone, Copy, Debug)]
enum Condition {
    Status(PackStatus),
    /// Latched.
    Level(FailsafeLevel),
    /// Of the state that is shown: the worse of what is found here and what is reported.
    State(ChargeState),
    /// Found here.
    Found(Faults),
    /// Reported by the pack, or by the component that measures it.
    Reported(Faults),
    ReportedState(ChargeState),
    /// As the pack reports it.
    Mode(Modes),
}

/// A row of the table.
#[derive(Debug)]
struct Row {
    condition: Condition,
    consequences: Consequences,
    /// Reason for which arming is refused, if it is.
    failure: Option<ArmingFailure>,
}

const fn row(condition: Condition, consequences: Consequences, failure: Option<ArmingFailure>) -> Row {
    Row {
        condition,
        consequences,
        failure,
    }
}

const BOTH: Consequences = Consequences::all();
const NOT_READY: Consequences = Consequences::NOT_READY;
const NONE: Consequences = Consequences::empty();

/// A low or critical level is latched by a threshold: arming names that of the voltage, unless the charge is below its own.
static TABLE: [Row; 20] = {
    use ArmingFailure::*;
    use ChargeState::{Critical, Emergency, Failed as FailedState, Unhealthy as UnhealthyState};
    use Condition::*;
    [
        row(Status(PackStatus::Unhealthy), BOTH, Some(Unhealthy)),
        row(Status(PackStatus::NotConnected), NONE, Some(Unhealthy)),
        row(Status(PackStatus::Unknown), NONE, Some(Unhealthy)),
        row(Level(FailsafeLevel::Unhealthy), BOTH, Some(Unhealthy)),
        row(Level(FailsafeLevel::Low), BOTH, Some(LowVoltage)),
        row(Level(FailsafeLevel::Critical), BOTH, Some(CriticalVoltage)),
        row(Found(Faults::CELL_FAIL), BOTH, Some(Failed)),
        row(Reported(Faults::CELL_FAIL), BOTH, Some(Failed)),
        row(Reported(Faults::BAD_BATTERY), BOTH, Some(Failed)),
        row(ReportedState(FailedState), BOTH, Some(Failed)),
        row(State(FailedState), BOTH, Some(Failed)),
        row(Found(Faults::CELLS_CONFIGURATION), BOTH, Some(WrongCells)),
        row(Found(Faults::OVER_TEMPERATURE), BOTH, Some(TooHot)),
        row(
            Found(Faults::CONTRADICTED_CHARGE),
            NOT_READY,
            Some(ContradictedCharge),
        ),
        row(ReportedState(UnhealthyState), BOTH, Some(ReportsUnhealthy)),
        row(State(UnhealthyState), BOTH, None),
        row(
            ReportedState(Emergency),
            NOT_READY,
            Some(ArmingFailure::Emergency),
        ),
        row(State(Emergency), NOT_READY, Some(ArmingFailure::Emergency)),
        row(State(Critical), NOT_READY, None),
        row(Mode(Modes::STORING), NOT_READY, None),
    ]
};

impl Condition {
    fn holds(self, state: &BatteryState) -> bool {
        match self {
            Self::Status(status) => state.status == status,
            Self::Level(level) => state.failsafe == level,
            Self::State(charge_state) => state.firm_charge_state() == charge_state,
            Self::Found(fault) => state.readings.faults.contains(fault),
            Self::Reported(fault) => state.readings.reported.faults.contains(fault),
            Self::Mode(mode) => state.readings.reported.modes.contains(mode),
            Self::ReportedState(charge_state) => state.readings.reported.charge_state == Some(charge_state),
        }
    }
}

fn conditions(state: &BatteryState) -> impl Iterator<Item = &'static Row> {
    TABLE.iter().filter(|row| row.condition.holds(state))
}

/// Consequences of all conditions of a pack in this state for ground stations.
pub fn consequences(state: &BatteryState) -> Consequences {
    conditions(state).fold(Consequences::empty(), |all, row| all | row.consequences)
}

/// Reasons for which arming is refused, in any order and perhaps repeatedly.
pub fn refusals(state: &BatteryState) -> impl Iterator<Item = ArmingFailure> {
    conditions(state).filter_map(|row| match row.failure {
        Some(ArmingFailure::WrongCells) if state.has_unclear_cells() => Some(ArmingFailure::UnclearCells),
        failure => failure,
    })
}

/// Whether a pack in this state must not be used, whatever its charge: a cell has failed, or it reports that it has.
pub fn has_failed(state: &BatteryState) -> bool {
    refusals(state).any(|failure| failure == ArmingFailure::Failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spikes_and_a_charger_without_sun_have_no_consequence() {
        let mut state = BatteryState::UNKNOWN;
        state.status = PackStatus::Healthy;
        state.readings.faults = Faults::SPIKES;
        // As DroneCAN chargers report too little voltage.
        state.readings.reported.faults = Faults::INCOMPATIBLE_VOLTAGE;
        assert_eq!(consequences(&state), Consequences::empty());
        assert_eq!(refusals(&state).count(), 0);
    }
}
