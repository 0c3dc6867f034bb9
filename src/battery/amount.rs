//! How much of what a pack stores.

use super::Contents;

/// An amount of what a pack stores, in the unit of its contents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// Electric charge, in milliampere-hours.
    Mah(f32),
    /// Fuel, in millilitres.
    Ml(f32),
}

// The unit takes the place that the option takes of a bare number.
const _: () = assert!(size_of::<Option<Amount>>() == size_of::<Option<f32>>());

impl Amount {
    /// So many milliampere-hours of charge, or millilitres of fuel.
    pub fn of(contents: Contents, number: f32) -> Self {
        match contents {
            Contents::Charge => Self::Mah(number),
            Contents::Fuel => Self::Ml(number),
        }
    }

    /// A charge in milliampere-hours; `None` for fuel.
    pub fn mah(self) -> Option<f32> {
        match self {
            Self::Mah(mah) => Some(mah),
            Self::Ml(_) => None,
        }
    }

    /// A volume of fuel in millilitres; `None` for charge.
    pub fn ml(self) -> Option<f32> {
        match self {
            Self::Ml(ml) => Some(ml),
            Self::Mah(_) => None,
        }
    }

    /// The number without its unit, for what takes either: as in ArduPilot, `BATT_LOW_MAH` and BATTERY_STATUS do.
    pub fn number(self) -> f32 {
        match self {
            Self::Mah(number) | Self::Ml(number) => number,
        }
    }
}
