//! The scenarios, a table each.

use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::Mode;

use super::{Action, Scenario, Step};
use crate::sim::{PackModel, SHUNT_OHM, SimulatedPack};

impl Scenario {
    /// All scenarios.
    pub const ALL: [&'static Self; 4] = [&DRAIN, &SWAP, &COLD, &LOOSE_WIRE];

    /// The one of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|scenario| scenario.name == name)
    }
}

/// Drives ahead.
const fn drive(throttle: i16) -> [Action; 3] {
    [
        Action::Mode(Mode::Manual),
        Action::Arm(ArmState::Armed),
        Action::Throttle(throttle),
    ]
}

const FULL_THROTTLE: &[Action] = &drive(1000);

const STOP: &[Action] = &[Action::Throttle(0), Action::Arm(ArmState::Disarmed)];

/// A full pack is driven until it is empty.
static DRAIN: Scenario = Scenario {
    name: "drain",
    summary: "a full pack is driven at full throttle until the monitor calls it low, then critical, and stops the rover.",
    speedup: 35.0,
    pack: SimulatedPack::full(PackModel::LIPO_3S_2200),
    takes_any_pack: true,
    parameters: &drain_parameters(2.2),
    steps: &drive_until(2100),
    end_s: 2105,
    sights: &DRAIN_SIGHTS,
};

/// A pack with three cells that is set up as one of 2200 mAh, of which a load can draw `capacity_ah`.
const fn drain_parameters(capacity_ah: f32) -> [(&'static str, f32); 8] {
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
const fn drive_until(at_s: u32) -> [Step; 2] {
    [
        (30, "the driver arms and drives at full throttle", FULL_THROTTLE),
        (at_s, "the driver disarms", STOP),
    ]
}

/// Consequence of a pack that runs empty.
const DRAIN_SIGHTS: [(&str, &[&str]); 3] = [
    ("low", &["Battery 1 low", "Battery 1 is low"]),
    ("critical", &["Battery 1 critical", "Battery 1 is critical"]),
    ("HOLD", &["HOLD, armed"]),
];

/// What a load can draw at −10 °C, of 2.2 Ah: 75 %, by the specification of Samsung's INR18650-15L (version 3.21, 7.5,
/// temperature dependence of discharge capacity). A LiPo of its own was not found.
const COLD_CAPACITY_AH: f32 = 0.75 * 2.2;

/// The drive of `drain` in the cold.
static COLD: Scenario = Scenario {
    name: "cold",
    summary: "the drive of `drain` at −10 °C, simplified: 2.2 times the resistance, and 75 % of the capacity that the monitor is given; low comes some ten minutes earlier.",
    speedup: 25.0,
    pack: SimulatedPack::full(PackModel::LIPO_3S_2200_COLD),
    takes_any_pack: false,
    parameters: &drain_parameters(COLD_CAPACITY_AH),
    steps: &drive_until(1500),
    end_s: 1505,
    sights: &DRAIN_SIGHTS,
};

/// A used pack is unplugged, and a full one plugged in.
static SWAP: Scenario = Scenario {
    name: "swap",
    summary: "a pack with 35 % left is unplugged from the disarmed rover, which USB keeps running, and a full one plugged in.",
    speedup: 1.0,
    pack: SimulatedPack::charged(PackModel::LIPO_3S_2200, 0.35),
    takes_any_pack: false,
    parameters: &[
        ("BATT_CELLS", 3.0),
        ("BATT_CAPACITY", 2200.0),
        ("BATT_LOW_VOLT", 10.5),
    ],
    steps: &[
        (20, "the pack is unplugged", &[Action::Unplug]),
        (
            30,
            "a full pack is plugged in",
            &[Action::PlugIn(SimulatedPack::full(PackModel::LIPO_3S_2200))],
        ),
    ],
    end_s: 60,
    sights: &[("the swap", &["Battery 1 swapped"])],
};

/// A wire of the power monitor comes loose while driving.
static LOOSE_WIRE: Scenario = Scenario {
    name: "loose-wire",
    summary: "a wire of the power monitor comes loose while driving; the last voltage is held, after 5 s the rover stops (BATT_FS_UNH_ACT), then the wire is put back.",
    speedup: 1.0,
    pack: SimulatedPack::charged(PackModel::LIPO_3S_2200, 0.8),
    takes_any_pack: false,
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
        (10, "the driver arms and drives at half throttle", &drive(500)),
        (
            20,
            "a wire of the power monitor comes loose",
            &[Action::Set("SIM_BATT_FAULT", 5.0)],
        ),
        (
            35,
            "the wire is put back, and the driver releases the throttle",
            &[Action::Set("SIM_BATT_FAULT", 0.0), Action::Throttle(0)],
        ),
        (
            50,
            "the driver goes on",
            &[Action::Mode(Mode::Manual), Action::Throttle(500)],
        ),
        (60, "the driver disarms", STOP),
    ],
    end_s: 65,
    sights: &[
        ("unhealthy", &["Battery 1 unhealthy"]),
        ("failsafe", &["Battery 1 is missing"]),
        ("HOLD", &["HOLD, armed"]),
        ("healthy again", &["Battery 1 healthy again"]),
    ],
};

#[cfg(test)]
mod tests {
    use super::*;
    use rover_battmon::parameter::{ParameterId, Parameters};

    #[test]
    fn every_step_can_be_done_in_its_turn() {
        for scenario in Scenario::ALL {
            let times: Vec<_> = scenario.steps.iter().map(|(at_s, ..)| *at_s).collect();
            assert!(times.is_sorted(), "{}: {times:?}", scenario.name);
            assert!(
                times.iter().all(|at_s| *at_s < scenario.end_s),
                "{}: {times:?}",
                scenario.name
            );
            scenario.set_up(&mut Parameters::defaults());
            for action in scenario.steps.iter().flat_map(|(.., actions)| *actions) {
                if let Action::Set(name, value) = action {
                    let id = ParameterId::from_name(name.as_bytes()).expect(name);
                    Parameters::defaults().set(id, *value).expect(name);
                }
            }
        }
    }

    #[test]
    fn each_takes_about_a_minute_and_has_a_name_of_its_own() {
        for scenario in Scenario::ALL {
            let wall_s = f64::from(scenario.end_s) / scenario.speedup;
            assert!((45.0..=75.0).contains(&wall_s), "{}: {wall_s} s", scenario.name);
            let same = Scenario::ALL.iter().filter(|other| other.name == scenario.name);
            assert_eq!(same.count(), 1);
            assert!(Scenario::named(scenario.name).is_some());
        }
        assert!(Scenario::named("flood").is_none());
    }
}
