//! Parameters of thermometers for packs without one, with ArduPilot's names.

#[cfg(not(target_os = "none"))]
use super::{Documentation, TakesEffect};
use super::{Kind, Listed, Parameter, Range, means};

/// Number of thermometers.
pub const THERMOMETER_COUNT: usize = 3;

/// `TEMP1_TYPE` of one that is not in use.
pub(in crate::parameter) const THERMOMETER_DISABLED: f32 = 0.0;

/// Flash key of the first parameter, and keys reserved for each thermometer.
const FIRST_KEY: u16 = 1216;
const KEYS_PER_THERMOMETER: u16 = 16;

/// Coefficients of the voltage's powers.
const COEFFICIENTS: Range = Range::Between(-100_000.0, 100_000.0);

/// Rows of the parameters of one thermometer.
#[derive(Clone, Copy, Debug)]
pub struct ThermometerRows {
    /// `TEMP1_TYPE`
    pub kind: ThermometerParameter,
    /// `TEMP1_PIN`
    pub pin: ThermometerParameter,
    /// `TEMP1_A0` to `TEMP1_A5`
    pub coefficients: [ThermometerParameter; 6],
    /// `TEMP1_MSG_ID`
    pub message_id: ThermometerParameter,
    /// `TEMP1_SRC`
    pub source: ThermometerParameter,
    /// `TEMP1_SRC_ID`
    pub source_id: ThermometerParameter,
}

macro_rules! thermometers {
    ($($number:literal $kind:ident $pin:ident $message_id:ident $source:ident $source_id:ident
        [$($power:literal $coefficient:ident)*])*) => {
        parameters! {
            /// A parameter of a thermometer.
            ThermometerParameter

            $($kind {
                key: key($number, 0),
                name: concat!("TEMP", $number, "_TYPE"),
                kind: Kind::Int8,
                default: THERMOMETER_DISABLED,
                range: Range::OneOf(&[(0, means("Disabled")), (5, means("Analog")), (6, means("DroneCAN"))]),
                label: concat!("Thermometer ", $number, ": type"),
                description: "Sensor of a pack's temperature, for a pack whose own sensor has none.",
            }
            $pin {
                key: key($number, 1),
                name: concat!("TEMP", $number, "_PIN"),
                kind: Kind::Int8,
                default: -1.0,
                range: super::battery::ANALOG_PINS,
                listed: Listed::WithThermometer($number),
                label: concat!("Thermometer ", $number, ": pin"),
                description: "Pin of an analog thermometer, which is pulled up. Arming is refused while anything else is read there.",
            }
            $($coefficient {
                key: key($number, 2 + $power),
                name: concat!("TEMP", $number, "_A", $power),
                kind: Kind::Real32,
                default: 0.0,
                range: COEFFICIENTS,
                listed: Listed::WithThermometer($number),
                step: 0.0001,
                label: concat!("Thermometer ", $number, ": coefficient ", $power),
                description: concat!("Factor of the pin's voltage to the power of ", $power, " in the temperature in °C. While \
                                      all are 0, it is unknown."),
            })*
            $message_id {
                key: key($number, 8),
                name: concat!("TEMP", $number, "_MSG_ID"),
                kind: Kind::Int32,
                default: 0.0,
                range: Range::Between(0.0, 65_535.0),
                listed: Listed::WithThermometer($number),
                label: concat!("Thermometer ", $number, ": message id"),
                description: "Device id in the Temperature messages of a DroneCAN thermometer.",
            }
            $source {
                key: key($number, 9),
                name: concat!("TEMP", $number, "_SRC"),
                kind: Kind::Int8,
                default: 0.0,
                range: Range::OneOf(&[(0, means("None")), (3, means("Battery Index"))]),
                listed: Listed::WithThermometer($number),
                label: concat!("Thermometer ", $number, ": source"),
                description: "What the temperature is of.",
            }
            $source_id {
                key: key($number, 10),
                name: concat!("TEMP", $number, "_SRC_ID"),
                kind: Kind::Int8,
                default: 0.0,
                range: Range::Between(0.0, crate::pack::MAX_PACKS as f32),
                listed: Listed::WithThermometer($number),
                label: concat!("Thermometer ", $number, ": pack"),
                description: "Number of the pack, from 1. 0: none.",
            })*
        }

        impl ThermometerParameter {
            /// The rows of all thermometers.
            pub const THERMOMETERS: [ThermometerRows; THERMOMETER_COUNT] = [$(ThermometerRows {
                kind: Self::$kind,
                pin: Self::$pin,
                coefficients: [$(Self::$coefficient),*],
                message_id: Self::$message_id,
                source: Self::$source,
                source_id: Self::$source_id,
            }),*];
        }
    };
}

const fn key(number: u16, row: u16) -> u16 {
    FIRST_KEY + KEYS_PER_THERMOMETER * (number - 1) + row
}

thermometers! {
    1 Temp1Type Temp1Pin Temp1MsgId Temp1Src Temp1SrcId
        [0 Temp1A0 1 Temp1A1 2 Temp1A2 3 Temp1A3 4 Temp1A4 5 Temp1A5]
    2 Temp2Type Temp2Pin Temp2MsgId Temp2Src Temp2SrcId
        [0 Temp2A0 1 Temp2A1 2 Temp2A2 3 Temp2A3 4 Temp2A4 5 Temp2A5]
    3 Temp3Type Temp3Pin Temp3MsgId Temp3Src Temp3SrcId
        [0 Temp3A0 1 Temp3A1 2 Temp3A2 3 Temp3A3 4 Temp3A4 5 Temp3A5]
}
