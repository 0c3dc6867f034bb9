//! Parameter tables: of the vehicle, of its sticks, of thermometers, of a pack, of the simulator, and constants for ground stations.

/// Declares a table: an enum of its parameters, and a row for each. A row names further fields of [`Parameter`] and
/// [`Documentation`] if they differ from [`Parameter::DEFAULT`] and [`Documentation::DEFAULT`].
///
/// Documentation is left out of the firmware, where it would take 7 KB of flash.
macro_rules! parameters {
    ($(#[$about:meta])* $group:ident $($id:ident {
        key: $key:expr,
        name: $name:expr,
        kind: $kind:expr,
        default: $default:expr,
        range: $range:expr,
        $($option:ident: $option_value:expr,)*
    } Documentation {
        label: $label:expr,
        description: $description:expr,
        $($detail:ident: $detail_value:expr,)*
    })*) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        #[repr(u8)]
        pub enum $group {
            $(#[doc = concat!("The row `", stringify!($id), "` of the table.")] $id,)*
        }

        impl $group {
            /// Number of parameters in the table.
            pub const COUNT: usize = [$(Self::$id),*].len();

            /// All parameters, in the order of the table.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$id),*];

            /// The first parameter.
            pub const FIRST: Self = Self::ALL[0];

            /// The next one in the order of the table.
            pub(in crate::parameter) fn next(self) -> Option<Self> {
                Self::ALL.get(self as usize + 1).copied()
            }

            /// The parameter with this name, case-insensitive.
            pub(in crate::parameter) fn from_name(name: &[u8]) -> Option<Self> {
                let is_meant = |parameter: &Self| parameter.row().name.as_bytes().eq_ignore_ascii_case(name);
                Self::ALL.iter().copied().find(is_meant)
            }

            /// Row in the table.
            #[allow(clippy::needless_update, reason = "a row may name all fields")]
            pub const fn row(self) -> &'static Parameter {
                match self {
                    $(Self::$id => const {
                        &Parameter {
                            key: $key,
                            name: $name,
                            kind: $kind,
                            default: $default,
                            range: $range,
                            $($option: $option_value,)*
                            #[cfg(not(target_os = "none"))]
                            documentation: Documentation {
                                label: $label,
                                description: $description,
                                $($detail: $detail_value,)*
                                ..Documentation::DEFAULT
                            },
                            ..Parameter::DEFAULT
                        }
                    },)*
                }
            }
        }
    };
}

mod battery;
mod ground_station;
mod monitor_kind;
mod range;
#[cfg(not(target_os = "none"))]
mod simulation;
pub(super) mod sticks;
mod thermometer;
mod vehicle;

pub use battery::{BatteryParameter, MAX_CONTROLLERS};
pub use ground_station::GroundStationParameter;
pub use monitor_kind::{FuelKind, MonitorKind, PartKind};
pub(crate) use monitor_kind::{MonitorInput, TICK_TIMEOUT_US};
pub use range::{Meaning, Range, means};
#[cfg(not(target_os = "none"))]
pub use simulation::SimulationParameter;
pub use sticks::StickParameter;
pub(super) use thermometer::THERMOMETER_DISABLED;
pub use thermometer::{THERMOMETER_COUNT, TemperatureSensor, ThermometerParameter};
pub use vehicle::{VehicleParameter, serial_baud};

/// One row of a table.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Flash key, of a pack's or thermometer's parameter that of the first one; 0 if it is constant. Never changed or reused.
    pub key: u16,
    /// Name, ArduPilot 4.6's if it has the parameter; of a pack's or thermometer's parameter without the prefix.
    pub name: &'static str,
    /// Type reported to ground stations.
    pub kind: Kind,
    /// Default value, in the parameter's unit;
    /// [`ParameterId::default_value`](super::ParameterId::default_value) has an exception.
    pub default: f32,
    /// Valid values.
    pub range: Range,
    /// Whether it can be set, and whether it is saved.
    pub access: Access,
    /// When it is in lists. It can always be read and set by name.
    pub listed: Listed,
    /// Documentation for users.
    #[cfg(not(target_os = "none"))]
    pub documentation: Documentation,
}

impl Parameter {
    /// A setting that bears on the drive and is in every list. What each row has of its own is empty.
    const DEFAULT: Self = Self {
        key: 0,
        name: "",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[]),
        access: Access::Setting(Bearing::Drive),
        listed: Listed::Always,
        #[cfg(not(target_os = "none"))]
        documentation: Documentation::DEFAULT,
    };
}

/// Documentation of a parameter for users; not in the firmware.
#[cfg(not(target_os = "none"))]
#[derive(Clone, Copy, Debug)]
pub struct Documentation {
    /// Increment of a ground station's controls, in the parameter's unit.
    pub step: f32,
    /// Unit, empty for a plain number.
    pub unit: &'static str,
    /// When a change takes effect.
    pub takes_effect: TakesEffect,
    /// Short label.
    pub label: &'static str,
    /// Description.
    pub description: &'static str,
}

#[cfg(not(target_os = "none"))]
impl Documentation {
    /// A plain whole number that takes effect at once. The texts are empty.
    const DEFAULT: Self = Self {
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "",
        description: "",
    };
}

/// Type of a parameter. On the wire every value is a float.
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

/// Whether a parameter can be set, and whether it is saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// A ground station sets it, and it is saved.
    Setting(Bearing),
    /// It shows a value of the firmware's own. Not saved.
    ReadOnly,
    /// It is always at its default. Not saved.
    Constant,
    /// A ground station sets it to 1, which acts at once; it reads 0. Not saved.
    Trigger,
}

/// The purpose that a setting bears on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bearing {
    /// Measuring, failsafes, arming or driving: the rover does not arm while its owner's value is not known.
    Drive,
    /// Nothing of these.
    Service,
}

/// When a parameter is in lists: only while what it sets up is in use, as in ArduPilot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Listed {
    /// Always; a pack's while the pack is monitored.
    Always,
    /// While the second serial port has this `SERIAL1_PROTOCOL`.
    WithSerialProtocol(f32),
    /// While `CAN_P1_DRIVER` is not 0.
    WithCan,
    /// While the thermometer's `TYPE` is not 0.
    WithThermometer,
    /// While the pack's `MONITOR` is this.
    WithMonitor(MonitorKind),
    /// While the pack is monitored and a point of its curve is set.
    WithCurve,
}

/// When a change of a parameter takes effect.
#[cfg(not(target_os = "none"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TakesEffect {
    /// Immediately.
    AtOnce,
    /// After a restart of the board.
    AfterReboot,
}
