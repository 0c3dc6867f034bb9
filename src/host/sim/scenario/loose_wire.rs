//! A wire of the power monitor comes loose while driving.

use super::story::{Action, Plugged, Scenario, Sight, Step};
use crate::host::sim::{PackModel, SHUNT_OHM};
use crate::vehicle::ArmState;
use crate::vehicle::Mode;

/// See [`Scenario::summary`].
pub const LOOSE_WIRE: Scenario = Scenario {
    name: "loose-wire",
    summary: "a wire of the power monitor comes loose while driving; the last voltage is held, after 5 s the rover stops (BATT_FS_UNH_ACT), then the wire is put back.",
    speedup: 1.0,
    pack: Plugged {
        model: PackModel::LIPO_3S_2200,
        charge: 0.8,
    },
    parameters: &[
        // The INA226.
        ("BATT_MONITOR", 21.0),
        ("BATT_SHUNT", SHUNT_OHM),
        ("BATT_CELLS", 3.0),
        ("BATT_CAPACITY", 2200.0),
        ("BATT_LOW_VOLT", 10.5),
        ("BATT_FS_UNH_ACT", 2.0),
    ],
    steps: &[
        Step {
            at_s: 10,
            what: "the driver arms and drives at half throttle",
            actions: &[
                Action::Mode(Mode::Manual),
                Action::Arm(ArmState::Armed),
                Action::Throttle(500),
            ],
        },
        Step {
            at_s: 20,
            what: "a wire of the power monitor comes loose",
            actions: &[Action::Set("SIM_BATT_FAULT", 5.0)],
        },
        Step {
            at_s: 35,
            what: "the wire is put back, and the driver releases the throttle",
            actions: &[Action::Set("SIM_BATT_FAULT", 0.0), Action::Throttle(0)],
        },
        Step {
            at_s: 50,
            what: "the driver goes on",
            actions: &[Action::Mode(Mode::Manual), Action::Throttle(500)],
        },
        Step {
            at_s: 60,
            what: "the driver disarms",
            actions: &[Action::Throttle(0), Action::Arm(ArmState::Disarmed)],
        },
    ],
    end_s: 65,
    sights: &[
        Sight {
            name: "unhealthy",
            texts: &["Battery 1 unhealthy"],
        },
        Sight {
            name: "failsafe",
            texts: &["Battery 1 is missing"],
        },
        Sight {
            name: "HOLD",
            texts: &["HOLD, armed"],
        },
        Sight {
            name: "healthy again",
            texts: &["Battery 1 healthy again"],
        },
    ],
};
