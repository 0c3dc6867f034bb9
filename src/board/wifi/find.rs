//! Which board it is.
#![expect(unsafe_code, reason = "the section has no initialiser")]

use embassy_rp::Peri;
use embassy_rp::adc::{Adc, Channel, Config};
use embassy_rp::gpio::{Input, Pull};
use embassy_rp::peripherals::{ADC, PIN_25, PIN_29};

use crate::board::ResetReason;
use crate::board::adc::convert_once;
use crate::memory::retained::RetainedWords;
use crate::sensor::{AdcCount, AnalogPin};
use crate::wifi::Radio;

/// A third of VSYS at GP29 is 0.6 V at least: VSYS has 1.8 V or more. This is 0.16 V.
const ABSENT_DIVIDER_COUNTS: f32 = 200.0;

/// Written where RAM keeps its content over a reset: no radio has answered since power came on.
const NO_RADIO: u32 = 0x6e6f_5746;

#[unsafe(link_section = ".uninit.RADIO")]
static NO_RADIO_NOTE: RetainedWords<1> = RetainedWords::new();

/// The board by a look at the pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoardKind {
    /// GP29 has a divider.
    Pico,
    /// GP29 has none, and no radio has answered since power came on.
    WithoutRadio,
    /// GP29 has none, as on a Pico W. There are other boards without it.
    PossiblyPicoW,
    /// GP25 is pulled up, or the radio has answered.
    PicoW,
}

impl BoardKind {
    /// Whether the pins are set up for a radio.
    pub fn radio(self) -> Radio {
        match self {
            Self::Pico | Self::WithoutRadio => Radio::Absent,
            Self::PossiblyPicoW | Self::PicoW => Radio::Present,
        }
    }
}

/// Which board it is, by a look at GP25 and GP29 that drives neither.
///
/// On a Pico GP25 has the LED, and GP29 a third of VSYS. On a Pico W GP25 selects the radio's chip, and connects the divider
/// of VSYS to GP29 while it is high (Pico W datasheet, figure "schematic"). It is pulled low here. If it is high all the
/// same, the chip pulls it up; if nothing is at GP29 then, the divider is not connected.
pub fn find_board(
    reset_reason: ResetReason,
    adc: Peri<'_, ADC>,
    gp25: Peri<'_, PIN_25>,
    gp29: Peri<'_, PIN_29>,
) -> BoardKind {
    // Its pull-down stays until the conversion is done.
    let select = Input::new(gp25, Pull::Down);
    // Pulled down: a charge on a pin that floats would read as a divider. A Pico's divider of 200 and 100 kΩ still shows 319
    // counts with the strongest pull-down, of 50 kΩ, at 1.8 V.
    let _divider = Channel::new_pin(gp29, Pull::Down);
    let _adc = Adc::new_blocking(adc, Config::default());
    let converted = convert_once(AnalogPin::Gp29);
    match converted {
        // No Pico shows this: its LED is off then.
        _ if select.is_high() => BoardKind::PicoW,
        Ok(AdcCount(counts)) if counts < ABSENT_DIVIDER_COUNTS => without_divider(reset_reason),
        // Without a converter it is not known: the pins of a Pico stay untouched.
        Ok(_) | Err(_) => BoardKind::Pico,
    }
}

/// Each power-up is another chance: a supply that was slow to rise may have kept a radio from answering.
fn without_divider(reset_reason: ResetReason) -> BoardKind {
    if let ResetReason::PowerOn | ResetReason::RunPin | ResetReason::Debugger = reset_reason {
        NO_RADIO_NOTE.set([0]);
    }
    match NO_RADIO_NOTE.get() {
        [NO_RADIO] => BoardKind::WithoutRadio,
        _ => BoardKind::PossiblyPicoW,
    }
}

/// No radio answers: the next start leaves its pins alone, unless it is a power-up.
pub(super) fn note_that_no_radio_answers() {
    NO_RADIO_NOTE.set([NO_RADIO]);
}
