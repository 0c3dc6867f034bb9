//! Analog pins, and what is wired to them, with its scales.

use super::analog_pin::AnalogPin;
use super::conversions::{ADC_FULL_SCALE, Conversions};
use crate::parameter::{BatteryParameter, PackParameters};

/// Pin of an analog level sensor (`BATT_FL_PIN`).
pub(super) fn level_pin(pack: PackParameters<'_>) -> Option<AnalogPin> {
    AnalogPin::from_gpio(pack.get_whole(BatteryParameter::FlPin))
}

/// GPIO number of the pulse input (`BATT_CURR_PIN`).
const PULSE_GPIO: i32 = 17;

/// Whether a pack that is measured by pulses is wired to the pulse input (`BATT_CURR_PIN`).
pub(super) fn uses_pulses(pack: PackParameters<'_>) -> bool {
    pack.get_whole(BatteryParameter::CurrPin) == PULSE_GPIO
}

/// Analog wiring of a pack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalogWiring {
    /// Pin of the voltage divider (`BATT_VOLT_PIN`).
    pub voltage_pin: Option<AnalogPin>,
    /// Scale of the voltage.
    pub divider: VoltageDivider,
    /// Pin of the current sensor (`BATT_CURR_PIN`).
    pub current_pin: Option<AnalogPin>,
    /// Scale of the current.
    pub current_sensor: CurrentSensor,
    /// Pin of a fuel level sensor (`BATT_FL_PIN`).
    pub level_pin: Option<AnalogPin>,
    /// Voltage at which full throttle draws `BATT_AMP_PERVLT` amperes, in volts (`BATT_MAX_VOLT`).
    pub full_throttle_voltage_v: f32,
}

/// Scale of a voltage divider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageDivider {
    /// Pack voltage divided by pin voltage, without a unit (`BATT_VOLT_MULT`).
    pub multiplier: f32,
    /// Pin voltage at zero pack voltage, in volts (`BATT_VLT_OFFSET`).
    pub offset_v: f32,
}

/// Scale of an analog current sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentSensor {
    /// Amperes per volt at the pin (`BATT_AMP_PERVLT`).
    pub amperes_per_volt: f32,
    /// Pin voltage at zero current, in volts (`BATT_AMP_OFFSET`).
    pub offset_v: f32,
}

impl VoltageDivider {
    /// The pack's voltage, in volts: `(pin voltage − offset) × multiplier`.
    pub fn pack_voltage_v(&self, pin_voltage_v: f32) -> f32 {
        (pin_voltage_v - self.offset_v) * self.multiplier
    }
}

impl CurrentSensor {
    /// The pack's current, in amperes: `(pin voltage − offset) × amperes per volt`; negative while charging.
    pub fn current_a(&self, pin_voltage_v: f32) -> f32 {
        (pin_voltage_v - self.offset_v) * self.amperes_per_volt
    }
}

impl AnalogWiring {
    /// The highest voltage that can be measured of a pack at the divider on the board, in volts; `None` if its pin is another.
    pub fn board_divider_range_v(&self) -> Option<f32> {
        let is_boards = self.voltage_pin == Some(AnalogPin::Gp26);
        is_boards.then(|| {
            let full_scale = Conversions::of(ADC_FULL_SCALE).mean();
            self.divider.pack_voltage_v(full_scale.pin_voltage_v())
        })
    }

    /// From the live parameters of a pack.
    pub fn from_parameters(pack: PackParameters<'_>) -> Self {
        let pin = |parameter| AnalogPin::from_gpio(pack.get_whole(parameter));
        Self {
            voltage_pin: pin(BatteryParameter::VoltPin),
            divider: VoltageDivider {
                multiplier: pack.get(BatteryParameter::VoltMult),
                offset_v: pack.get(BatteryParameter::VltOffset),
            },
            current_pin: pin(BatteryParameter::CurrPin),
            current_sensor: CurrentSensor {
                amperes_per_volt: pack.get(BatteryParameter::AmpPervlt),
                offset_v: pack.get(BatteryParameter::AmpOffset),
            },
            level_pin: level_pin(pack),
            full_throttle_voltage_v: pack.get(BatteryParameter::MaxVolt),
        }
    }
}
