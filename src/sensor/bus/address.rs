//! Where a part is.

/// Where a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Address {
    /// At a 7-bit address of the I2C bus.
    I2c(u8),
    /// At the SPI bus, behind its one chip select.
    ChipSelect,
}

/// What lies outside is reserved (I2C specification UM10204, table 4).
const LOWEST: u8 = 0x08;
const HIGHEST: u8 = 0x77;

impl Address {
    /// The address a parameter names; `None` for 0 and for those that are reserved.
    pub fn from_parameter(value: i32) -> Option<Self> {
        u8::try_from(value)
            .ok()
            .filter(|address| (LOWEST..=HIGHEST).contains(address))
            .map(Self::I2c)
    }
}
