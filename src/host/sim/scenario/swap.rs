//! A used pack is unplugged, and a full one plugged in.

use super::story::{Action, Plugged, Scenario, Sight, Step};
use crate::host::sim::PackModel;

/// See [`Scenario::summary`].
pub const SWAP: Scenario = Scenario {
    name: "swap",
    summary: "a pack with 35 % left is unplugged from the disarmed rover, which USB keeps running, and a full one plugged in.",
    speedup: 1.0,
    pack: Plugged {
        model: PackModel::LIPO_3S_2200,
        charge: 0.35,
    },
    parameters: &[
        ("BATT_CELLS", 3.0),
        ("BATT_CAPACITY", 2200.0),
        ("BATT_LOW_VOLT", 10.5),
    ],
    steps: &[
        Step {
            at_s: 20,
            what: "the pack is unplugged",
            actions: &[Action::Unplug],
        },
        Step {
            at_s: 30,
            what: "a full pack is plugged in",
            actions: &[Action::PlugIn(Plugged {
                model: PackModel::LIPO_3S_2200,
                charge: 1.0,
            })],
        },
    ],
    end_s: 60,
    sights: &[Sight {
        name: "the swap",
        texts: &["Battery 1 swapped"],
    }],
};
