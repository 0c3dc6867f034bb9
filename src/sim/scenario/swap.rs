//! A used pack is unplugged, and a full one plugged in.

use super::{Action, Plugged, Scenario, Sight, Step};
use crate::sim::PackModel;

/// See [`Scenario::summary`].
pub const SWAP: Scenario = Scenario {
    name: "swap",
    summary: "a pack with 35 % left is unplugged from the disarmed rover, which USB keeps running, and a full one plugged in.",
    speedup: 1.0,
    pack: Plugged {
        model: PackModel::LIPO_3S_2200,
        charge: 0.35,
    },
    steps: &[
        Step {
            at_s: 0,
            what: None,
            actions: &[
                Action::Set("BATT_CELLS", 3.0),
                Action::Set("BATT_CAPACITY", 2200.0),
                Action::Set("BATT_LOW_VOLT", 10.5),
            ],
        },
        Step {
            at_s: 20,
            what: Some("the pack is unplugged"),
            actions: &[Action::Unplug],
        },
        Step {
            at_s: 30,
            what: Some("a full pack is plugged in"),
            actions: &[Action::PlugIn(Plugged {
                model: PackModel::LIPO_3S_2200,
                charge: 1.0,
            })],
        },
        Step {
            at_s: 60,
            what: None,
            actions: &[],
        },
    ],
    sights: &[Sight {
        name: "the swap",
        text: "Battery 1 swapped",
    }],
};
