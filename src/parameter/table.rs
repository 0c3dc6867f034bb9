//! What there is to know of every parameter: one table for the vehicle, one for each pack, one for the simulator.

/// Declares one table: the names of its parameters in code, and a row for each, in the same order.
///
/// What only the documentation needs is left out of the firmware: it would be 7 KB of it.
macro_rules! parameters {
    ($(#[$about:meta])* $group:ident $($id:ident {
        key: $key:expr,
        name: $name:expr,
        kind: $kind:expr,
        default: $default:expr,
        range: $range:expr,
        step: $step:expr,
        unit: $unit:expr,
        takes_effect: $takes_effect:expr,
        label: $label:expr,
        description: $description:expr $(,)?
    })*) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        #[repr(u8)]
        pub enum $group {
            $(#[doc = concat!("The row `", stringify!($id), "` of the table.")] $id,)*
        }

        impl $group {
            /// How many there are.
            pub const COUNT: usize = [$(Self::$id),*].len();

            /// Every one of them, in the order of the table.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$id),*];

            /// The first of them.
            pub const FIRST: Self = Self::ALL[0];

            /// The one whose row has this name. Case is ignored.
            pub(in crate::parameter) fn from_name(name: &[u8]) -> Option<Self> {
                let is_meant = |parameter: &Self| parameter.row().name.as_bytes().eq_ignore_ascii_case(name);
                Self::ALL.iter().copied().find(is_meant)
            }

            /// Its row in the table.
            pub fn row(self) -> &'static Parameter {
                match self {
                    $(Self::$id => const {
                        &Parameter {
                            key: $key,
                            name: $name,
                            kind: $kind,
                            default: $default,
                            range: $range,
                            #[cfg(not(target_os = "none"))]
                            documentation: Documentation {
                                step: $step,
                                unit: $unit,
                                takes_effect: $takes_effect,
                                label: $label,
                                description: $description,
                            },
                        }
                    },)*
                }
            }
        }
    };
}

mod battery;
mod range;
#[cfg(not(target_os = "none"))]
mod simulation;
mod vehicle;

pub use battery::BatteryParameter;
pub use range::{Meaning, Range, means};
#[cfg(not(target_os = "none"))]
pub use simulation::SimulationParameter;
pub use vehicle::VehicleParameter;

/// One row of a table.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// The key of its value in flash, for a pack's parameter that of the first pack. It stays for ever and is never given
    /// to another parameter.
    pub key: u16,
    /// Its name, ArduPilot 4.6's where that has the parameter. A pack's parameter has the pack's prefix before it.
    pub name: &'static str,
    /// The type a ground station is told.
    pub kind: Kind,
    /// The value it has until somebody sets it, in the parameter's unit, unless
    /// [`ParameterId::default_value`](super::ParameterId::default_value) makes an exception.
    pub default: f32,
    /// Which values it takes.
    pub range: Range,
    /// What its owner wants to know of it.
    #[cfg(not(target_os = "none"))]
    pub documentation: Documentation,
}

/// What a parameter's owner wants to know of it. The firmware goes without.
#[cfg(not(target_os = "none"))]
#[derive(Clone, Copy, Debug)]
pub struct Documentation {
    /// The step by which a ground station's controls change it, in the parameter's unit.
    pub step: f32,
    /// The unit of its value, empty for a plain number.
    pub unit: &'static str,
    /// When a change takes effect.
    pub takes_effect: TakesEffect,
    /// A few words for a list.
    pub label: &'static str,
    /// What it does, for its owner.
    pub description: &'static str,
}

/// The type of a parameter's value. On the wire every value travels as a float.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number, `MAV_PARAM_TYPE_INT8`.
    Int8,
    /// A whole number, `MAV_PARAM_TYPE_INT16`.
    Int16,
    /// A whole number, `MAV_PARAM_TYPE_INT32`.
    Int32,
    /// `MAV_PARAM_TYPE_REAL32`.
    Real32,
}

/// When a change of a parameter takes effect.
#[cfg(not(target_os = "none"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TakesEffect {
    /// With the next reading or message.
    AtOnce,
    /// When the board has been restarted.
    AfterReboot,
}
