//! The simulated fault (`SIM_BATT_FAULT`).

use crate::parameter::SimulationParameter;
use crate::tasks::Shared;

/// What is wrong with the simulated pack or its sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    None,
    /// The ADC does not answer.
    Stalled,
    /// The divider's sense wire is disconnected.
    WireOff,
    /// The rail is noisy.
    Noisy,
    /// One cell of the pack is far below the others.
    WeakCell,
    /// A wire of the I2C bus is disconnected: no device answers.
    BusOff,
}

impl Fault {
    /// The one that is set now.
    pub fn now(shared: &Shared) -> Self {
        match shared.with(|autopilot| autopilot.parameters().get_whole(SimulationParameter::BattFault)) {
            1 => Self::Stalled,
            2 => Self::WireOff,
            3 => Self::Noisy,
            4 => Self::WeakCell,
            5 => Self::BusOff,
            _ => Self::None,
        }
    }
}
