//! Parameters of thermometers for packs without one, with ArduPilot's names.

#[cfg(not(target_os = "none"))]
use super::Documentation;
use super::{Kind, Listed, Parameter, Range, means};

/// Number of thermometers.
pub const THERMOMETER_COUNT: usize = 3;

/// A thermometer, identified by the prefix of its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum TemperatureSensor {
    /// That of `TEMP1_`.
    First,
    /// That of `TEMP2_`.
    Second,
    /// That of `TEMP3_`.
    Third,
}

impl TemperatureSensor {
    /// All thermometers.
    pub const ALL: [Self; THERMOMETER_COUNT] = [Self::First, Self::Second, Self::Third];

    /// The next one.
    pub(in crate::parameter) fn next(self) -> Option<Self> {
        Self::ALL.get(self as usize + 1).copied()
    }

    /// Prefix of its parameters' names.
    pub fn prefix(self) -> &'static str {
        match self {
            Self::First => "TEMP1_",
            Self::Second => "TEMP2_",
            Self::Third => "TEMP3_",
        }
    }
}

/// `TEMP1_TYPE` of one that is not in use.
pub(in crate::parameter) const THERMOMETER_DISABLED: f32 = 0.0;

/// Coefficients of the voltage's powers.
const COEFFICIENTS: Range = Range::Between(-100_000.0, 100_000.0);

macro_rules! thermometer {
    ($($coefficient:ident $power:literal)*) => {
        parameters! {
            /// A parameter of a thermometer.
            ThermometerParameter

            Type {
                key: 1216,
                name: "TYPE",
                kind: Kind::Int8,
                default: THERMOMETER_DISABLED,
                range: Range::OneOf(&[(0, means("Disabled")), (5, means("Analog")), (6, means("DroneCAN"))]),
            } Documentation {
                label: "Thermometer: type",
                description: "Sensor of a pack's temperature, for a pack whose own sensor has none.",
            }
            Pin {
                key: 1217,
                name: "PIN",
                kind: Kind::Int8,
                default: -1.0,
                range: super::battery::ANALOG_PINS,
                listed: Listed::WithThermometer,
            } Documentation {
                label: "Thermometer: pin",
                description: "Pin of an analog thermometer, which is pulled up, so sensors with an output of their own (LM35, TMP36) do not work. Arming is refused while anything else is read there.",
            }
            $($coefficient {
                key: 1218 + $power,
                name: concat!("A", $power),
                kind: Kind::Real32,
                default: 0.0,
                range: COEFFICIENTS,
                listed: Listed::WithThermometer,
            } Documentation {
                label: concat!("Thermometer: coefficient ", $power),
                description: concat!("Factor of the pin's voltage to the power of ", $power, " in the temperature in °C. While \
                                      all are 0, it is unknown."),
                step: 0.0001,
            })*
            MessageId {
                key: 1224,
                name: "MSG_ID",
                kind: Kind::Int32,
                default: 0.0,
                range: Range::Between(0.0, 65_535.0),
                listed: Listed::WithThermometer,
            } Documentation {
                label: "Thermometer: message id",
                description: "Device id in the Temperature messages of a DroneCAN thermometer.",
            }
            Source {
                key: 1225,
                name: "SRC",
                kind: Kind::Int8,
                default: 0.0,
                range: Range::OneOf(&[(0, means("None")), (3, means("Battery Index"))]),
                listed: Listed::WithThermometer,
            } Documentation {
                label: "Thermometer: source",
                description: "What the temperature is of.",
            }
            SourceId {
                key: 1226,
                name: "SRC_ID",
                kind: Kind::Int8,
                default: 0.0,
                range: Range::Between(0.0, crate::pack::MAX_PACKS as f32),
                listed: Listed::WithThermometer,
            } Documentation {
                label: "Thermometer: pack",
                description: "Number of the pack, from 1. 0: none.",
            }
        }

        impl ThermometerParameter {
            /// `TEMP1_A0` to `TEMP1_A5`.
            pub const COEFFICIENTS: [Self; 6] = [$(Self::$coefficient),*];
        }
    };
}

thermometer! { A0 0 A1 1 A2 2 A3 3 A4 4 A5 5 }
