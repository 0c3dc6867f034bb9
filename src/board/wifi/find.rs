//! Which board it is.

use embassy_rp::Peri;
use embassy_rp::adc::{Adc, Channel, Config};
use embassy_rp::gpio::{Input, Pull};
use embassy_rp::peripherals::{ADC, PIN_25, PIN_29};

use crate::board::adc::convert;
use crate::sensor::{AdcCount, AnalogPin};
use crate::wifi::Radio;

/// Where a third of VSYS is at GP29, it is 0.6 V at least: VSYS has 1.8 V or more. This is 0.16 V.
const ABSENT_DIVIDER_COUNTS: u16 = 200;

/// Whether the board is a Pico W, which has a radio, by a look at GP25 and GP29 that drives neither.
///
/// On a Pico GP25 has the LED, and GP29 a third of VSYS. On a Pico W GP25 selects the radio's chip, and connects the divider
/// of VSYS to GP29 while it is high (Pico W datasheet, figure "schematic"). It is pulled low here. If it is high all the
/// same, the chip pulls it up; if nothing is at GP29 then, the divider is not connected.
pub fn find_radio(adc: Peri<'_, ADC>, gp25: Peri<'_, PIN_25>, gp29: Peri<'_, PIN_29>) -> Radio {
    let is_pulled_up = Input::new(gp25, Pull::Down).is_high();
    let _divider = Channel::new_pin(gp29, Pull::None);
    let _adc = Adc::new_blocking(adc, Config::default());
    match convert(AnalogPin::Gp29) {
        Ok(AdcCount(counts)) if counts < ABSENT_DIVIDER_COUNTS => Radio::Present,
        // No Pico shows this: its LED is off then.
        Ok(_) | Err(_) if is_pulled_up => Radio::Present,
        // Without a converter it is not known: the pins of a Pico stay untouched.
        Ok(_) | Err(_) => Radio::Absent,
    }
}
