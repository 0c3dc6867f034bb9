//! What batteries and chargers on the bus report of their condition, as MAVLink has it.

use crate::battery::{ChargeState, Faults, Reported};

/// `STATUS_FLAG_CHARGING` of `uavcan.equipment.power.BatteryInfo`.
const CHARGING: u16 = 1 << 1;

/// The fault that goes with each of its other flags: hot, cold, overload, bad battery, service needed, and an error of its
/// management system. In use, and charged, are none.
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
}
