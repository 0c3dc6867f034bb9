//! How a pack is wired to a part.

use super::Address;
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters};
use crate::sensor::AnalogWiring;

/// How a pack is wired to a part on the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wiring {
    /// Where the part is (`BATT_I2C_ADDR`); `None` has it looked for.
    pub address: Option<Address>,
    /// Which of a part's channels measures the pack, from 1 (`BATT_CHANNEL`).
    pub channel: u8,
    /// The resistor the current flows through, in ohms (`BATT_SHUNT`).
    pub shunt_ohm: f32,
    /// The highest current that has to be counted, in amperes (`BATT_MAX_AMPS`).
    pub max_current_a: f32,
    /// The pin of a converter that measures the voltage, by ArduPilot's number (`BATT_VOLT_PIN`).
    pub voltage_pin: i32,
    /// The pin of a converter that measures the current, by ArduPilot's number (`BATT_CURR_PIN`).
    pub current_pin: i32,
    /// What a converter's pins are wired to.
    pub analog: AnalogWiring,
}

impl Wiring {
    /// The wiring the parameters of a pack describe.
    pub fn from_parameters(parameters: &Parameters, pack: Pack) -> Self {
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(pack));
        let whole = |parameter: BatteryParameter| parameters.get_whole(parameter.of(pack));
        Self {
            address: Address::from_parameter(whole(BatteryParameter::I2cAddr)),
            channel: u8::try_from(whole(BatteryParameter::Channel)).unwrap_or(1),
            shunt_ohm: value(BatteryParameter::Shunt),
            max_current_a: value(BatteryParameter::MaxAmps),
            voltage_pin: whole(BatteryParameter::VoltPin),
            current_pin: whole(BatteryParameter::CurrPin),
            analog: AnalogWiring::from_parameters(parameters, pack),
        }
    }
}
