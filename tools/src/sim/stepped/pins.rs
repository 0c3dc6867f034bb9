//! Analog inputs at which voltages are set.

use std::cell::Cell;
use std::future::pending;

use rover_battmon::battery::ReadError;
use rover_battmon::sensor::{ADC_FULL_SCALE, ADC_REFERENCE_V, AdcCount, AnalogIn, AnalogPin};

/// The converter's count at this voltage at a pin.
pub fn adc_count(pin_v: f32) -> AdcCount {
    let full_scale = f32::from(ADC_FULL_SCALE);
    AdcCount(
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
    async fn convert(&mut self, pin: AnalogPin) -> Result<AdcCount, ReadError> {
        match self.converter.get() {
            Converter::Working => Ok(adc_count(self.voltage_v(pin))),
            Converter::Stalled => pending().await,
        }
    }
}
