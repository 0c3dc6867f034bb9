//! The wires from the RP2040 to the chip on a Pico W (Pico W datasheet, "Wireless interface").

use super::super::pio::Outputs;
use super::super::register::bit;

/// WL_ON: the chip has power while it is high.
pub const POWER: usize = 23;
/// WL_D: data in both directions, and the interrupt to the host.
pub const DATA: usize = 24;
/// WL_CS: low while the chip is selected.
pub const SELECT: usize = 25;
/// WL_CLK, and a third of VSYS.
pub const CLOCK: usize = 29;

/// How the RP2040's pins are set up: sets of pins, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wiring {
    /// What SIO makes of the pins that it drives.
    pub sio: Outputs,
    /// Pins that the PIO block decides on.
    pub pio: u32,
    pub pulled_up: u32,
    pub pulled_down: u32,
    pub input_enabled: u32,
}

impl Wiring {
    /// Whether neither a driver nor a pull holds this pin.
    pub fn floats(&self, pin: usize, pio: Outputs) -> bool {
        let held = pio.driven & self.pio | self.sio.driven | self.pulled_up | self.pulled_down;
        !bit(held, pin as u32)
    }

    /// The levels at the pins, given what the PIO block makes of them. What nothing drives is low, unless it is pulled up.
    pub fn levels(&self, pio: Outputs) -> Levels {
        let driven_by_pio = pio.driven & self.pio;
        let driven = driven_by_pio | self.sio.driven;
        Levels(pio.high & driven_by_pio | self.sio.high & self.sio.driven | self.pulled_up & !driven)
    }
}

/// The levels at all pins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Levels(u32);

impl Levels {
    pub fn is_high(self, pin: usize) -> bool {
        bit(self.0, pin as u32)
    }
}
