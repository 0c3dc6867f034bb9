//! Analog inputs at which voltages are set.

use std::cell::Cell;

use rover_battmon::battery::ReadError;
use rover_battmon::sensor::{
    ADC_FULL_SCALE, ADC_REFERENCE_V, AnalogIn, AnalogPin, AnalogReadings, Conversions, WantedReadings,
};
use rover_battmon::time::Instant;

/// Conversions of this voltage at a pin.
pub fn conversions(pin_v: f32) -> Conversions {
    let full_scale = f32::from(ADC_FULL_SCALE);
    Conversions::of(
        (pin_v / ADC_REFERENCE_V * full_scale)
            .round()
            .clamp(0.0, full_scale) as u16,
    )
}

/// The state of the converter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Converter {
    /// It works.
    #[default]
    Working,
    /// It never ends a conversion.
    Stalled,
}

/// The analog inputs. A reference to them is the converter.
#[derive(Debug, Default)]
pub struct Pins {
    /// In the order of [`AnalogPin::ALL`].
    voltages: [Cell<f32>; AnalogPin::ALL.len()],
    converter: Cell<Converter>,
}

impl Pins {
    /// Sets the voltage at a pin.
    pub fn set(&self, pin: AnalogPin, pin_v: f32) {
        for (each, voltage) in AnalogPin::ALL.iter().zip(&self.voltages) {
            if *each == pin {
                voltage.set(pin_v);
            }
        }
    }

    /// Sets the state of the converter.
    pub fn set_converter(&self, converter: Converter) {
        self.converter.set(converter);
    }

    fn voltage_v(&self, pin: AnalogPin) -> f32 {
        let mut pins = AnalogPin::ALL.iter().zip(&self.voltages);
        pins.find(|(each, _)| **each == pin)
            .map_or(0.0, |(_, voltage)| voltage.get())
    }
}

impl AnalogIn for &Pins {
    fn read(&mut self, _: Instant, _: WantedReadings) -> AnalogReadings {
        if self.converter.get() == Converter::Stalled {
            return AnalogReadings::failed(ReadError::Timeout);
        }
        let mut readings = AnalogReadings::NONE;
        for pin in AnalogPin::ALL {
            readings.set(pin, Ok(conversions(self.voltage_v(pin))));
        }
        readings
    }
}
