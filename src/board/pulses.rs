//! The pin for pulses.

use embassy_rp::Peri;
use embassy_rp::gpio::{Input, Pull};
use embassy_rp::peripherals::PIN_17;

use crate::tasks::SeenPulses;

/// The pin, as one that can be waited for.
pub type PulseInput = Input<'static>;

/// GP17 as an input. It is pulled up: flow sensors only pull down.
pub fn pulse_input(pin: Peri<'static, PIN_17>) -> PulseInput {
    Input::new(pin, Pull::Up)
}

/// Of the one pin.
pub static PULSES_SEEN: SeenPulses = SeenPulses::new();
