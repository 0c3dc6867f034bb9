//! Where a part is on the bus.

/// A 7-bit I2C address that a device can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct Address(u8);

/// What lies outside is reserved (I2C specification UM10204, table 4).
const LOWEST: u8 = 0x08;
const HIGHEST: u8 = 0x77;

impl Address {
    /// An address that is written down in the code.
    ///
    /// # Panics
    /// While compiling, when no device can have it.
    pub const fn known(address: u8) -> Self {
        assert!(LOWEST <= address && address <= HIGHEST);
        Self(address)
    }

    /// The address a parameter names; `None` for 0 and for those that are reserved.
    pub fn from_parameter(value: i32) -> Option<Self> {
        u8::try_from(value)
            .ok()
            .filter(|address| (LOWEST..=HIGHEST).contains(address))
            .map(Self)
    }

    /// As it is sent, without the bit for the direction.
    pub fn bits(self) -> u8 {
        self.0
    }
}
