//! What cells are made of.

/// What the cells are made of; the numbers are MAVLink's `MAV_BATTERY_TYPE` and those of `BATT_CHEM`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum Chemistry {
    /// Lithium polymer.
    #[default]
    LiPo = 1,
    /// Lithium iron phosphate.
    LiFe = 2,
    /// Lithium ion, in cylindrical cells such as the 18650.
    LiIon = 3,
    /// Nickel metal hydride.
    NiMh = 4,
}
