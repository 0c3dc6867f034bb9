//! Pins: which of them a test's wires are soldered to, and what the chip connects them to inside.

use rp2040_emu::Bus as CrateBus;

use super::clock::Cycle;
use super::pwm::{Pwm, PwmOutput};
use super::register::bit;
use super::uart::PinConnection;

/// GPIO_CTRL.FUNCSEL values (datasheet 2.19.2).
const FUNCTION_UART: u32 = 2;
const FUNCTION_PWM: u32 = 4;
const FUNCTION_SIO: u32 = 5;
/// PADS_BANK0: input enable, output disable (datasheet 2.19.6.3).
const PAD_INPUT_ENABLE: u32 = 6;
const PAD_OUTPUT_DISABLE: u32 = 7;

/// The two pins a test's UART wire is soldered to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UartPins {
    pub tx: usize,
    pub rx: usize,
}

impl UartPins {
    pub const DEFAULTS: [Self; 2] = [Self { tx: 0, rx: 1 }, Self { tx: 8, rx: 9 }];

    /// Function 2 gives a pin to a UART in groups of four: UART0 has GPIO 0-3, 12-15, 16-19 and
    /// 28-29, UART1 the others; TX is the first of a group, RX the second.
    pub fn check(self, uart: usize) {
        let owner = |pin: usize| usize::from(matches!(pin / 4, 1 | 2 | 5 | 6));
        let belongs = |pin: usize, role| pin < 30 && pin % 4 == role && owner(pin) == uart;
        assert!(
            belongs(self.tx, 0),
            "GPIO{} is not a TX pin of UART{uart}",
            self.tx
        );
        assert!(
            belongs(self.rx, 1),
            "GPIO{} is not an RX pin of UART{uart}",
            self.rx
        );
    }
}

/// Which ends of the wire lead to the UART as the pin multiplexers and pads are set.
pub fn uart_connection(chip: &CrateBus, uart: usize, pins: UartPins) -> PinConnection {
    pins.check(uart);
    let is_uart = |pin| chip.io_bank0.funcsel(pin) == FUNCTION_UART;
    let pad = |pin: usize| chip.pads_bank0.pads[pin];
    PinConnection {
        tx: is_uart(pins.tx) && !bit(pad(pins.tx), PAD_OUTPUT_DISABLE),
        rx: is_uart(pins.rx) && bit(pad(pins.rx), PAD_INPUT_ENABLE),
    }
}

/// What drives a pin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PinDrive {
    /// Nothing in the chip: it is what is connected to it that decides.
    Nothing,
    /// The processor, through SIO.
    Level(bool),
    Pwm(PwmOutput),
}

/// What drives a pin as the pin multiplexer and the pad are set.
pub fn pin_drive(chip: &CrateBus, pwm: &Pwm, pin: usize, now: Cycle) -> PinDrive {
    let is_output = bit(chip.sio.gpio_oe_masked(), pin as u32);
    match chip.io_bank0.funcsel(pin) {
        _ if bit(chip.pads_bank0.pads[pin], PAD_OUTPUT_DISABLE) => PinDrive::Nothing,
        FUNCTION_PWM => PinDrive::Pwm(pwm.output(pin, now)),
        FUNCTION_SIO if is_output => PinDrive::Level(bit(chip.sio.gpio_out_masked(), pin as u32)),
        _ => PinDrive::Nothing,
    }
}

/// The level a pin is driven to at a moment; `None` when nothing in the chip drives it.
pub fn driven_level(chip: &CrateBus, pwm: &Pwm, pin: usize, now: Cycle) -> Option<bool> {
    match pin_drive(chip, pwm, pin, now) {
        PinDrive::Nothing => None,
        PinDrive::Level(level) => Some(level),
        PinDrive::Pwm(_) => Some(pwm.level(pin, now)),
    }
}
