//! The drive of `drain` in the cold.

use super::story::{Action, Plugged, Scenario, Sight, Step};
use crate::battery::ArmState;
use crate::sim::PackModel;
use crate::vehicle::Mode;

/// What a load can draw at −10 °C, of 2.2 Ah: 75 %, by the specification of Samsung's INR18650-15L (version 3.21, 7.5,
/// temperature dependence of discharge capacity). A LiPo of its own was not found.
const COLD_CAPACITY_AH: f32 = 0.75 * 2.2;

/// See [`Scenario::summary`].
pub const COLD: Scenario = Scenario {
    name: "cold",
    summary: "the drive of `drain` at −10 °C, simplified: 2.2 times the resistance, and 75 % of the capacity that the monitor is given; low comes some ten minutes earlier.",
    speedup: 25.0,
    pack: Plugged {
        model: PackModel::LIPO_3S_2200_COLD,
        charge: 1.0,
    },
    parameters: &[
        ("SIM_BATT_CAP_AH", COLD_CAPACITY_AH),
        ("BATT_CELLS", 3.0),
        ("BATT_CAPACITY", 2200.0),
        ("BATT_LOW_VOLT", 10.8),
        ("BATT_CRT_VOLT", 10.5),
        ("BATT_FS_CRT_ACT", 2.0),
        // At this speed a computer that is busy for a moment is late by seconds.
        ("FS_TIMEOUT", 100.0),
        // A ground station's heartbeats come once a second of the wall clock.
        ("FS_GCS_TIMEOUT", 120.0),
    ],
    steps: &[
        Step {
            at_s: 30,
            what: "the driver arms and drives at full throttle",
            actions: &[
                Action::Mode(Mode::Manual),
                Action::Arm(ArmState::Armed),
                Action::Throttle(1000),
            ],
        },
        Step {
            at_s: 1500,
            what: "the driver disarms",
            actions: &[Action::Throttle(0), Action::Arm(ArmState::Disarmed)],
        },
    ],
    end_s: 1505,
    sights: &[
        Sight {
            name: "low",
            texts: &["Battery 1 low", "Battery 1 is low"],
        },
        Sight {
            name: "critical",
            texts: &["Battery 1 critical", "Battery 1 is critical"],
        },
        Sight {
            name: "HOLD",
            texts: &["HOLD, armed"],
        },
    ],
};
