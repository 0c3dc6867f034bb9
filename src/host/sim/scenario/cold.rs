//! The drive of `drain` in the cold.

use super::drain::{SIGHTS, drive_until, parameters};
use super::story::{Plugged, Scenario};
use crate::host::sim::PackModel;

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
    parameters: &parameters(COLD_CAPACITY_AH),
    steps: &drive_until(1500),
    end_s: 1505,
    sights: SIGHTS,
};
