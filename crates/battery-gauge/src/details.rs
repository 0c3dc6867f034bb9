//! Identity and ratings of a smart battery.

use core::fmt;
use core::hash::{Hash, Hasher};

use crate::Chemistry;

/// Capacity of a name, in bytes.
const NAME_BYTES: usize = 20;

/// Identity and ratings reported by a smart battery; most never change. `None` is not reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackDetails {
    /// Manufacturer.
    pub manufacturer: Name,
    /// The manufacturer's name of the device.
    pub device: Name,
    /// Serial number.
    pub serial_number: Option<i32>,
    /// Date of manufacture.
    pub manufactured: Option<Date>,
    /// Cell chemistry.
    pub chemistry: Option<Chemistry>,
    /// Charge cycles.
    pub cycle_count: Option<u16>,
    /// Design capacity, in milliampere-hours.
    pub design_capacity_mah: Option<f32>,
    /// Design voltage, in volts.
    pub design_voltage_v: Option<f32>,
    /// State of health: present full capacity, in percent of the design capacity.
    pub state_of_health_pct: Option<u8>,
}

impl PackDetails {
    /// Nothing is reported.
    pub const NONE: Self = Self {
        manufacturer: Name::EMPTY,
        device: Name::EMPTY,
        serial_number: None,
        manufactured: None,
        chemistry: None,
        cycle_count: None,
        design_capacity_mah: None,
        design_voltage_v: None,
        state_of_health_pct: None,
    };

    /// Whether nothing is reported.
    pub fn is_empty(&self) -> bool {
        let Self {
            manufacturer,
            device,
            serial_number,
            manufactured,
            chemistry,
            cycle_count,
            design_capacity_mah,
            design_voltage_v,
            state_of_health_pct,
        } = self;
        manufacturer.is_empty()
            && device.is_empty()
            && serial_number.is_none()
            && manufactured.is_none()
            && chemistry.is_none()
            && cycle_count.is_none()
            && design_capacity_mah.is_none()
            && design_voltage_v.is_none()
            && state_of_health_pct.is_none()
    }
}

impl Hash for PackDetails {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self {
            manufacturer,
            device,
            serial_number,
            manufactured,
            chemistry,
            cycle_count,
            design_capacity_mah,
            design_voltage_v,
            state_of_health_pct,
        } = self;
        (
            manufacturer,
            device,
            serial_number,
            manufactured,
            chemistry,
            cycle_count,
        )
            .hash(state);
        let ratings = [*design_capacity_mah, *design_voltage_v];
        (
            ratings.map(|rating| rating.map(f32::to_bits)),
            state_of_health_pct,
        )
            .hash(state);
    }
}

impl Default for PackDetails {
    fn default() -> Self {
        Self::NONE
    }
}

/// A day.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Date {
    /// The year, such as 2026.
    pub year: u16,
    /// 1 to 12.
    pub month: u8,
    /// 1 to 31.
    pub day: u8,
}

/// A short name in printable ASCII; empty if not reported.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Name {
    bytes: [u8; NAME_BYTES],
    length: u8,
}

impl Name {
    /// Not reported.
    pub const EMPTY: Self = Self {
        bytes: [0; NAME_BYTES],
        length: 0,
    };

    /// The printable characters, truncated to the capacity.
    pub fn from_ascii(characters: &[u8]) -> Self {
        let mut name = Self::EMPTY;
        let printable = characters
            .iter()
            .filter(|byte| byte.is_ascii_graphic() || **byte == b' ');
        for (to, from) in name.bytes.iter_mut().zip(printable) {
            *to = *from;
            name.length += 1;
        }
        name
    }

    /// The characters.
    pub fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or(&[])
    }

    /// Whether it is not reported.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{}\"", self.as_bytes().escape_ascii())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_is_printable_and_truncated() {
        assert_eq!(Name::from_ascii(b"Acme\0\xff 3S").as_bytes(), b"Acme 3S");
        assert_eq!(Name::from_ascii(&[b'x'; 32]).as_bytes(), [b'x'; NAME_BYTES]);
        assert!(Name::from_ascii(b"\0\n").is_empty());
    }
}
