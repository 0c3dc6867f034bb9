//! What is known of the controller, and what batteries and chargers on the bus report of their condition, as MAVLink has it.

use core::fmt;

use crate::battery::{ChargeState, Faults, Reported};

/// `STATUS_FLAG_CHARGING` of `uavcan.equipment.power.BatteryInfo`.
const CHARGING: u16 = 1 << 1;

/// The fault that goes with each of its other flags: hot, cold, overload, bad battery, service needed, and an error of its
/// management system. "In use" and "charged" are not faults.
const OF_BATTERIES: [(u16, Faults); 6] = [
    (1 << 3, Faults::OVER_TEMPERATURE),
    (1 << 4, Faults::UNDER_TEMPERATURE),
    (1 << 5, Faults::OVER_CURRENT),
    (1 << 6, Faults::BAD_BATTERY),
    (1 << 7, Faults::NEEDS_SERVICE),
    (1 << 8, Faults::NEEDS_SERVICE),
];

/// The fault that goes with each bit of `fault_flags` in `mppt.Stream`: too much and too little voltage, overcurrent, too
/// hot. Too little is the sun's, at dusk.
const OF_CHARGERS: [(u16, Faults); 4] = [
    (1 << 0, Faults::INCOMPATIBLE_VOLTAGE),
    (1 << 1, Faults::INCOMPATIBLE_VOLTAGE),
    (1 << 2, Faults::OVER_CURRENT),
    (1 << 3, Faults::OVER_TEMPERATURE),
];

/// From `status_flags` of BatteryInfo.
pub(super) fn of_battery(flags: u16) -> Reported {
    Reported {
        faults: faults(flags, &OF_BATTERIES),
        charge_state: (flags & CHARGING != 0).then_some(ChargeState::Charging),
    }
}

/// From `fault_flags` of `mppt.Stream`.
pub(super) fn of_charger(flags: u8) -> Reported {
    Reported {
        faults: faults(flags.into(), &OF_CHARGERS),
        ..Reported::NONE
    }
}

fn faults(flags: u16, table: &[(u16, Faults)]) -> Faults {
    let set = table.iter().filter(|(flag, _)| flags & flag != 0);
    set.fold(Faults::empty(), |faults, (_, fault)| faults | *fault)
}

/// What is known of the controller and its bus. Numbers count since the start, modulo 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanStatus {
    /// Whether it takes part in the bus.
    pub state: CanState,
    /// Whether it interrupts as it should.
    pub interrupt: CanInterrupt,
    /// How often it was bus-off.
    pub bus_offs: u32,
    /// How often it had lost its configuration and was configured again.
    pub lost_setups: u32,
    /// Received frames that were lost, at least: the controller or the queue behind it had no room.
    pub lost_frames: u32,
    /// Frames that were discarded as they could not be sent.
    pub unsent_frames: u32,
    /// Looks at the controller: without more of them what serves it stands still.
    pub looks: u32,
}

impl CanStatus {
    /// Before the controller is set up.
    pub const STARTING: Self = Self {
        state: CanState::Starting,
        interrupt: CanInterrupt::Working,
        bus_offs: 0,
        lost_setups: 0,
        lost_frames: 0,
        unsent_frames: 0,
        looks: 0,
    };
}

/// Whether the controller takes part in the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum CanState {
    /// It is not set up yet.
    Starting,
    /// It does not answer.
    NoAnswer,
    /// It takes part.
    Active,
    /// It takes part, but there were too many errors: an error counter is above 127 (ISO 11898-1).
    Passive,
    /// It takes no part: its transmit error counter has passed 255 (ISO 11898-1), or the bus is never idle.
    BusOff,
}

/// Whether the controller interrupts when there is something to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum CanInterrupt {
    /// As far as is known.
    Working,
    /// The line is open or stuck: the controller is looked at at intervals.
    Dead,
}

/// What the controller's state is announced as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum CanReport {
    /// The crystal is too slow for the bit rate.
    ImpossibleBitRate,
    /// The controller does not answer.
    NoAnswer,
    /// The controller had lost its configuration, and was configured again.
    Reconfigured,
    /// There are too many errors.
    Passive,
    /// How often the controller was bus-off since the start.
    BusOff(u32),
    /// The bus works again.
    Working,
    /// The interrupt line is open or stuck.
    NoInterrupt,
    /// This many received frames were lost since the start.
    FramesLost(u32),
}

impl CanReport {
    /// Whether something is wrong.
    pub fn is_fault(self) -> bool {
        self != Self::Working
    }
}

impl fmt::Display for CanReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ImpossibleBitRate => f.write_str("CAN off: 1 Mbit/s needs a 16 MHz crystal"),
            Self::NoAnswer => f.write_str("CAN controller does not answer"),
            Self::Reconfigured => f.write_str("CAN controller was reset and configured again"),
            Self::Passive => f.write_str("CAN bus has errors: check wires and bit rate"),
            Self::BusOff(times) => write!(f, "CAN bus off, times: {times}"),
            Self::Working => f.write_str("CAN bus works"),
            Self::NoInterrupt => f.write_str("CAN interrupt line GP17 does not work"),
            Self::FramesLost(frames) => write!(f, "CAN frames lost: {frames}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_of_a_battery_has_its_fault_or_none() {
        for (bit, fault) in [
            (0, Faults::empty()),
            (1, Faults::empty()),
            (2, Faults::empty()),
            (3, Faults::OVER_TEMPERATURE),
            (4, Faults::UNDER_TEMPERATURE),
            (5, Faults::OVER_CURRENT),
            (6, Faults::BAD_BATTERY),
            (7, Faults::NEEDS_SERVICE),
            (8, Faults::NEEDS_SERVICE),
            (9, Faults::empty()),
            (10, Faults::empty()),
        ] {
            let reported = of_battery(1 << bit);
            assert_eq!(reported.faults, fault, "bit {bit}");
            let charging = (bit == 1).then_some(ChargeState::Charging);
            assert_eq!(reported.charge_state, charging, "bit {bit}");
        }
    }

    /// Of one STATUSTEXT.
    const TEXT_BYTES: usize = 50;

    #[test]
    fn texts_fit_one_message() {
        for report in [
            CanReport::ImpossibleBitRate,
            CanReport::Reconfigured,
            CanReport::Passive,
            CanReport::BusOff(u32::MAX),
            CanReport::NoInterrupt,
            CanReport::FramesLost(u32::MAX),
        ] {
            assert!(report.to_string().len() <= TEXT_BYTES, "{report}");
        }
    }
}
