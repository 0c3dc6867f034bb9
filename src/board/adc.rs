//! The converter behind an analog pin.

use embassy_rp::adc::{Adc, Async, Channel};

use crate::battery::ReadError;
use crate::sensor::{AdcCount, AnalogIn};

/// The pack's voltage at its pin.
///
/// Conversions are started one by one. embassy-rp's DMA burst would need fewer interrupts, but on a converter that has
/// stopped answering it waits without yielding, and then the watchdog is the only way out.
pub struct PackVoltageInput {
    adc: Adc<'static, Async>,
    channel: Channel<'static>,
}

impl PackVoltageInput {
    pub(super) fn new(adc: Adc<'static, Async>, channel: Channel<'static>) -> Self {
        Self { adc, channel }
    }
}

impl AnalogIn for PackVoltageInput {
    async fn convert(&mut self) -> Result<AdcCount, ReadError> {
        self.adc
            .read(&mut self.channel)
            .await
            .map(AdcCount)
            .map_err(|_| ReadError::Conversion)
    }
}
