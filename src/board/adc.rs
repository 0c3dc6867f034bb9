//! The converter behind the analog pins.

use embassy_rp::Peri;
use embassy_rp::adc::{Adc, Blocking, Channel, Config};
use embassy_rp::gpio::Pull;
use embassy_rp::pac;
use embassy_rp::peripherals::{ADC, PIN_26, PIN_27, PIN_28, PIN_29};

use crate::battery::ReadError;
use crate::sensor::{AdcCount, AnalogIn, AnalogPin, PinPull};

/// A conversion takes 96 cycles of the converter's 48 MHz clock (RP2040 datasheet 4.9.2), 250 of the processor's; each look at it
/// takes five at least.
const LOOKS: u32 = 200;

/// The number of the first analog pin.
const FIRST_PIN: usize = 26;

/// The analog pins GP26 to GP29; on a Pico W GP29 is the radio's.
///
/// A conversion takes 2 µs, less than going to sleep over it, so the processor looks until it is done. embassy-rp's own ways
/// are an interrupt for each conversion, and waiting for one without an end: on a converter that has stopped answering the
/// watchdog would then be the only way out.
pub struct AnalogInputs {
    // They keep the converter on and its pins theirs.
    _adc: Adc<'static, Blocking>,
    _channels: [Channel<'static>; 3],
    gp29: Option<Channel<'static>>,
}

impl AnalogInputs {
    /// Takes the converter and its pins, without pulls.
    pub fn new(
        adc: Peri<'static, ADC>,
        gp26: Peri<'static, PIN_26>,
        gp27: Peri<'static, PIN_27>,
        gp28: Peri<'static, PIN_28>,
        gp29: Option<Peri<'static, PIN_29>>,
    ) -> Self {
        Self {
            _adc: Adc::new_blocking(adc, Config::default()),
            _channels: [
                Channel::new_pin(gp26, Pull::None),
                Channel::new_pin(gp27, Pull::None),
                Channel::new_pin(gp28, Pull::None),
            ],
            gp29: gp29.map(|pin| Channel::new_pin(pin, Pull::None)),
        }
    }
}

impl AnalogIn for AnalogInputs {
    async fn convert(&mut self, pin: AnalogPin) -> Result<AdcCount, ReadError> {
        if pin == AnalogPin::Gp29 && self.gp29.is_none() {
            return Err(ReadError::PinOfRadio);
        }
        convert(pin)
    }

    fn pull(&mut self, pin: AnalogPin, pull: PinPull) {
        let pad = pac::PADS_BANK0.gpio(FIRST_PIN + pin as usize);
        pad.modify(|pad| pad.set_pue(pull == PinPull::Up));
    }
}

/// Converts the voltage at a pin that the converter has.
pub(super) fn convert(pin: AnalogPin) -> Result<AdcCount, ReadError> {
    let mut control = pac::ADC.cs().read();
    // One that has timed out and still runs: its result would be taken for this one's, and it may be another pin's.
    if !control.ready() {
        return Err(ReadError::Timeout);
    }
    control.set_ainsel(pin as u8);
    control.set_start_once(true);
    pac::ADC.cs().write_value(control);
    let done = (0..LOOKS)
        .map(|_| pac::ADC.cs().read())
        .find(|status| status.ready());
    match done {
        None => Err(ReadError::Timeout),
        Some(status) if status.err() => Err(ReadError::Conversion),
        Some(_) => Ok(AdcCount(pac::ADC.result().read().result())),
    }
}
