//! The faults of a pack.

use bitflags::bitflags;

bitflags! {
    /// Faults of a pack, with the bits of MAVLink's `MAV_BATTERY_FAULT`, which has no others than [`Faults::MAVLINK`].
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
        /// The packs of a sum rest at different voltages.
        const INCOMPATIBLE_VOLTAGE = 64;
        /// The pack reports that its firmware does not fit. It also stands for an unknown cause, such as a lost sensor.
        const INCOMPATIBLE_FIRMWARE = 128;
        /// The resting voltage does not fit `BATT_CELLS` cells of this chemistry, or the pack reports other cells than it should have.
        const CELLS_CONFIGURATION = 256;
        /// The pack reports that it is bad: it must not be used.
        const BAD_BATTERY = 1 << 13;
        /// The pack reports that it has to be serviced.
        const NEEDS_SERVICE = 1 << 14;
        /// A cell rests lower than any of its chemistry does at the charge that the pack reports.
        const CONTRADICTED_CHARGE = 1 << 15;
    }
}

impl Faults {
    /// Those that MAVLink has a bit for.
    pub const MAVLINK: Self = Self::from_bits_retain(0x1ff);

    /// Those that make a sufficiently charged pack FAILED: it must not be used.
    pub const FAILING: Self = Self::CELL_FAIL;

    /// Those that make a sufficiently charged pack UNHEALTHY.
    pub const UNFIT: Self = Self::CELLS_CONFIGURATION
        .union(Self::OVER_TEMPERATURE)
        .union(Self::SPIKES);
}
