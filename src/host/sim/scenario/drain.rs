//! A full pack is driven until it is empty.

use super::story::{Action, Plugged, Scenario, Sight, Step};
use crate::host::sim::PackModel;
use crate::vehicle::ArmState;
use crate::vehicle::Mode;

/// See [`Scenario::summary`].
pub const DRAIN: Scenario = Scenario {
    name: "drain",
    summary: "a full pack is driven at full throttle until the monitor calls it low, then critical, and stops the rover.",
    speedup: 35.0,
    pack: Plugged {
        model: PackModel::LIPO_3S_2200,
        charge: 1.0,
    },
    parameters: &parameters(2.2),
    steps: &drive_until(2100),
    end_s: 2105,
    sights: SIGHTS,
};

/// A pack with three cells that is set up as one of 2200 mAh, of which a load can draw `capacity_ah`.
pub(super) const fn parameters(capacity_ah: f32) -> [(&'static str, f32); 8] {
    [
        ("SIM_BATT_CAP_AH", capacity_ah),
        ("BATT_CELLS", 3.0),
        ("BATT_CAPACITY", 2200.0),
        ("BATT_LOW_VOLT", 10.8),
        ("BATT_CRT_VOLT", 10.5),
        ("BATT_FS_CRT_ACT", 2.0),
        // At this speed a computer that is busy for a moment is late by seconds.
        ("FS_TIMEOUT", 100.0),
        // A ground station's heartbeats come once a second of the wall clock.
        ("FS_GCS_TIMEOUT", 120.0),
    ]
}

/// A drive at full throttle.
pub(super) const fn drive_until(at_s: u32) -> [Step; 2] {
    [
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
            at_s,
            what: "the driver disarms",
            actions: &[Action::Throttle(0), Action::Arm(ArmState::Disarmed)],
        },
    ]
}

/// What a pack that runs empty leads to.
pub(super) const SIGHTS: &[Sight] = &[
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
];
