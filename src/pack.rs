//! Which packs there are.

use core::fmt;

/// Maximum number of packs, instances 0 to 8: `BATT_`, `BATT2_` to `BATT9_`.
pub const MAX_PACKS: usize = 9;

/// A pack, identified by its MAVLink instance and parameter prefix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum Pack {
    /// The pack of `BATT_`, instance 0.
    First,
    /// The pack of `BATT2_`, instance 1.
    Second,
    /// The pack of `BATT3_`, instance 2.
    Third,
    /// The pack of `BATT4_`, instance 3.
    Fourth,
    /// The pack of `BATT5_`, instance 4.
    Fifth,
    /// The pack of `BATT6_`, instance 5.
    Sixth,
    /// The pack of `BATT7_`, instance 6.
    Seventh,
    /// The pack of `BATT8_`, instance 7.
    Eighth,
    /// The pack of `BATT9_`, instance 8.
    Ninth,
}

impl Pack {
    /// All packs, in the order of their instances.
    pub const ALL: [Self; MAX_PACKS] = [
        Self::First,
        Self::Second,
        Self::Third,
        Self::Fourth,
        Self::Fifth,
        Self::Sixth,
        Self::Seventh,
        Self::Eighth,
        Self::Ninth,
    ];

    /// MAVLink instance, 0 to 8.
    pub fn instance(self) -> u8 {
        self as u8
    }

    /// Its number for users: its instance and 1, as in the parameters' names.
    pub fn number(self) -> u8 {
        self.instance() + 1
    }

    /// Its bit in masks of packs: bit 0 for the first.
    pub fn bit(self) -> u16 {
        1 << self.instance()
    }

    /// The pack with the next instance.
    pub fn next(self) -> Option<Self> {
        Self::from_instance(self.instance() + 1)
    }

    /// The pack with this instance, if valid.
    pub fn from_instance(instance: u8) -> Option<Self> {
        Self::ALL.get(usize::from(instance)).copied()
    }

    /// Prefix of its parameters' names.
    pub fn prefix(self) -> &'static str {
        match self {
            Self::First => "BATT_",
            Self::Second => "BATT2_",
            Self::Third => "BATT3_",
            Self::Fourth => "BATT4_",
            Self::Fifth => "BATT5_",
            Self::Sixth => "BATT6_",
            Self::Seventh => "BATT7_",
            Self::Eighth => "BATT8_",
            Self::Ninth => "BATT9_",
        }
    }
}

/// Writes the numbers of the packs in `mask`, a bit each, with commas between them.
pub(crate) fn write_packs(f: &mut fmt::Formatter<'_>, mask: u16) -> fmt::Result {
    let mut separator = "";
    for pack in Pack::ALL.into_iter().filter(|pack| mask & pack.bit() != 0) {
        write!(f, "{separator}{}", pack.number())?;
        separator = ", ";
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instances_round_trip() {
        for (instance, pack) in (0..).zip(Pack::ALL) {
            assert_eq!(pack.instance(), instance);
            assert_eq!(pack.bit(), 1 << instance);
            assert_eq!(Pack::from_instance(instance), Some(pack));
        }
        assert_eq!(Pack::from_instance(MAX_PACKS as u8), None);
    }
}
