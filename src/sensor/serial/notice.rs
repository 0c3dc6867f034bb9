//! What a device on the serial line reports of itself, for ground stations.

use core::fmt;

use super::conditions::{FuelCellError, FuelCellState, RichenPowerErrors, TorqeedoCondition, Urgency};

/// A change in the state of a device on the serial line, reported once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SerialNotice {
    /// What is wrong with a fuel cell.
    FuelCellError(FuelCellError),
    /// What a fuel cell does.
    FuelCellState(FuelCellState),
    /// What is wrong with RichenPower's generator.
    RichenPower(RichenPowerErrors),
    /// What a Torqeedo motor or its battery reports to be wrong.
    Torqeedo(TorqeedoCondition),
}

impl SerialNotice {
    /// How urgent it is.
    pub fn urgency(&self) -> Urgency {
        match self {
            Self::FuelCellError(error) => error.urgency(),
            Self::FuelCellState(state) => state.urgency(),
            Self::RichenPower(errors) => errors.urgency(),
            Self::Torqeedo(condition) if condition.is_good() => Urgency::Info,
            Self::Torqeedo(_) => Urgency::Warning,
        }
    }
}

impl fmt::Display for SerialNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FuelCellError(error) => write!(f, "{error}"),
            Self::FuelCellState(state) => write!(f, "{state}"),
            Self::RichenPower(errors) => write!(f, "{errors}"),
            Self::Torqeedo(condition) => write!(f, "{condition}"),
        }
    }
}
