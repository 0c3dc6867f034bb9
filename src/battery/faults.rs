//! What can be wrong with a pack.

use bitflags::bitflags;

bitflags! {
    /// What is wrong with a pack; the bits are those of MAVLink's `MAV_BATTERY_FAULT`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Faults: u16 {
        /// The cells have been discharged below what they survive unharmed.
        const DEEP_DISCHARGE = 1;
        /// The voltage rose above what the cells can have.
        const SPIKES = 2;
        /// A cell differs from the others, or has failed.
        const CELL_FAIL = 4;
        /// The load exceeds `BATT_WATT_MAX`.
        const OVER_CURRENT = 8;
        /// The pack is too hot.
        const OVER_TEMPERATURE = 16;
        /// The pack is too cold.
        const UNDER_TEMPERATURE = 32;
        /// The voltage is not one that `BATT_CELLS` cells of this chemistry can have at rest.
        const INCOMPATIBLE_VOLTAGE = 64;
    }
}
