//! The faults of a pack.

use bitflags::bitflags;

bitflags! {
    /// Faults of a pack, with the bits of MAVLink's `MAV_BATTERY_FAULT`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Faults: u16 {
        /// The cells are discharged below their safe minimum.
        const DEEP_DISCHARGE = 1;
        /// The voltage exceeded the cells' maximum.
        const SPIKES = 2;
        /// The cells are out of balance, or one has failed.
        const CELL_FAIL = 4;
        /// The load exceeds `BATT_WATT_MAX`.
        const OVER_CURRENT = 8;
        /// The pack is too hot.
        const OVER_TEMPERATURE = 16;
        /// The pack is too cold.
        const UNDER_TEMPERATURE = 32;
        /// The resting voltage does not fit `BATT_CELLS` cells of this chemistry.
        const INCOMPATIBLE_VOLTAGE = 64;
    }
}
