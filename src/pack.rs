//! Which packs there are.

use core::fmt;
use core::ops::{BitAnd, BitOr, Sub};

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

/// A set of packs, as the mask that parameters and commands have: bit 0 for the first. Its text is their numbers, with commas
/// between them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct PackSet(u16);

impl PackSet {
    /// No pack.
    pub const NONE: Self = Self(0);

    /// All packs.
    pub const ALL: Self = Self((1 << MAX_PACKS) - 1);

    /// The packs of this mask. Bits above the last pack are ignored.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits & Self::ALL.0)
    }

    /// Its mask.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether it has no pack.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether `pack` is in it.
    pub fn contains(self, pack: Pack) -> bool {
        self.0 >> pack.instance() & 1 != 0
    }

    /// Adds `pack`, and returns whether it was not in it.
    pub fn insert(&mut self, pack: Pack) -> bool {
        let was_in = self.contains(pack);
        self.0 |= 1 << pack.instance();
        !was_in
    }

    /// Removes `pack`.
    pub fn remove(&mut self, pack: Pack) {
        self.0 &= !(1 << pack.instance());
    }

    /// Its packs, in the order of their instances.
    pub fn iter(self) -> impl Iterator<Item = Pack> {
        Pack::ALL.into_iter().filter(move |pack| self.contains(*pack))
    }
}

impl FromIterator<Pack> for PackSet {
    fn from_iter<I: IntoIterator<Item = Pack>>(packs: I) -> Self {
        let mut set = Self::NONE;
        for pack in packs {
            set.insert(pack);
        }
        set
    }
}

impl BitOr for PackSet {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitAnd for PackSet {
    type Output = Self;

    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl Sub for PackSet {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

impl fmt::Display for PackSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for pack in self.iter() {
            write!(f, "{separator}{}", pack.number())?;
            separator = ", ";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instances_round_trip() {
        for (instance, pack) in (0..).zip(Pack::ALL) {
            assert_eq!(pack.instance(), instance);
            assert_eq!(Pack::from_instance(instance), Some(pack));
        }
        assert_eq!(Pack::from_instance(MAX_PACKS as u8), None);
    }

    #[test]
    fn a_set_has_the_packs_of_its_bits() {
        let mut set = PackSet::from_bits(0b1111_0000_0001);
        assert_eq!(set.bits(), 0b1_0000_0001, "ignored above the last pack");
        assert!(set.iter().eq([Pack::First, Pack::Ninth]));
        assert!(set.insert(Pack::Third) && !set.insert(Pack::Third));
        set.remove(Pack::First);
        assert!(set.contains(Pack::Third) && !set.contains(Pack::First));
        assert_eq!(set, PackSet::from_iter([Pack::Ninth, Pack::Third]));
        assert_eq!(set.to_string(), "3, 9");
        assert_eq!(PackSet::from_iter(Pack::ALL), PackSet::ALL);
    }

    #[test]
    fn sets_are_joined_cut_and_subtracted() {
        let (low, even) = (PackSet::from_bits(0b0111), PackSet::from_bits(0b1010));
        assert_eq!((low | even).bits(), 0b1111);
        assert_eq!((low & even).bits(), 0b0010);
        assert_eq!((low - even).bits(), 0b0101);
        assert!((low - PackSet::ALL).is_empty());
    }
}
