//! The converter behind the analog pins.

use embassy_rp::Peri;
use embassy_rp::adc::{Adc, Async, Channel, Config};
use embassy_rp::gpio::Pull;
use embassy_rp::peripherals::{ADC, PIN_26, PIN_27, PIN_28, PIN_29};

use super::Irqs;
use crate::battery::ReadError;
use crate::sensor::{AdcCount, AnalogIn, AnalogPin};

/// The analog pins GP26 to GP29.
///
/// Conversions are started one by one. embassy-rp's DMA burst would need fewer interrupts, but on a converter that has
/// stopped answering it waits without yielding, and then the watchdog is the only way out.
pub struct AnalogInputs {
    adc: Adc<'static, Async>,
    channels: [Channel<'static>; 4],
}

impl AnalogInputs {
    /// Takes the converter and its pins. The pins are left without pulls, which would bend a divider's ratio.
    pub fn new(
        adc: Peri<'static, ADC>,
        gp26: Peri<'static, PIN_26>,
        gp27: Peri<'static, PIN_27>,
        gp28: Peri<'static, PIN_28>,
        gp29: Peri<'static, PIN_29>,
    ) -> Self {
        Self {
            adc: Adc::new(adc, Irqs, Config::default()),
            channels: [
                Channel::new_pin(gp26, Pull::None),
                Channel::new_pin(gp27, Pull::None),
                Channel::new_pin(gp28, Pull::None),
                Channel::new_pin(gp29, Pull::None),
            ],
        }
    }
}

impl AnalogIn for AnalogInputs {
    async fn convert(&mut self, pin: AnalogPin) -> Result<AdcCount, ReadError> {
        let [gp26, gp27, gp28, gp29] = &mut self.channels;
        let channel = match pin {
            AnalogPin::Gp26 => gp26,
            AnalogPin::Gp27 => gp27,
            AnalogPin::Gp28 => gp28,
            AnalogPin::Gp29 => gp29,
        };
        self.adc
            .read(channel)
            .await
            .map(AdcCount)
            .map_err(|_| ReadError::Conversion)
    }
}
