//! Whether the board is a Pico W.

use embassy_rp::Peri;
use embassy_rp::adc::{Adc, Channel, Config};
use embassy_rp::gpio::{Input, Pull};
use embassy_rp::peripherals::{ADC, PIN_25, PIN_29};

/// Where a third of VSYS is at GP29, it is 0.6 V at least: VSYS has 1.8 V or more. This is 0.16 V.
const ABSENT_DIVIDER_COUNTS: u16 = 200;

/// Whether there is a radio.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Module {
    /// Raspberry Pi Pico: GP25 has its LED, GP29 a third of VSYS.
    Pico,
    /// Raspberry Pi Pico W: GP25 selects the radio's chip, and connects the divider of VSYS to GP29 while it is high.
    PicoW,
}

impl Module {
    /// Looks at GP25 and GP29 without driving either.
    ///
    /// GP25 is pulled low. If it is high all the same, the chip pulls it up; otherwise nothing but a Pico has a voltage at
    /// GP29.
    pub fn detect(
        adc: Peri<'_, ADC>,
        mut gp25: Peri<'_, PIN_25>,
        mut gp29: Peri<'_, PIN_29>,
    ) -> Self {
        let is_pulled_up = Input::new(gp25.reborrow(), Pull::Down).is_high();
        let mut divider = Channel::new_pin(gp29.reborrow(), Pull::None);
        let mut adc = Adc::new_blocking(adc, Config::default());
        match adc.blocking_read(&mut divider) {
            Ok(counts) if counts >= ABSENT_DIVIDER_COUNTS && !is_pulled_up => Self::Pico,
            // Nothing that a Pico can show. On another board without these two, nothing answers on the radio's bus.
            Ok(_) | Err(_) => Self::PicoW,
        }
    }
}
