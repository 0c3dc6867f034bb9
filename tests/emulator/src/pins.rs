//! Pins: which of them a test's wires are soldered to, and what the chip connects them to inside.

use super::adc::VsysConnection;
use super::bus::SystemBus;
use super::chip::Chip;
use super::circuit::{Circuit, PinSignal};
use super::clock::{Cycle, NEVER};
use super::cyw43::pins::{DATA, Wiring};
use super::gpio::{BusLevels, PINS, PadState};
use super::i2c::{I2c, Levels};
use super::peripheral::Peripheral;
use super::pio::Outputs;
use super::pwm::PwmOutput;
use super::register::bit;
use super::soc::Soc;
use super::spi::SpiConnection;
use super::uart::{PinConnection, Pull};

/// GPIO_CTRL.FUNCSEL values (datasheet 2.19.2).
const FUNCTION_SPI: u32 = 1;
const FUNCTION_UART: u32 = 2;
const FUNCTION_I2C: u32 = 3;
const FUNCTION_PWM: u32 = 4;
const FUNCTION_SIO: u32 = 5;
const FUNCTION_PIO0: u32 = 6;
const FUNCTION_PIO1: u32 = 7;
/// A third of VSYS, if the board connects it.
const VSYS_PIN: usize = 29;
/// PADS_BANK0: pull-down, pull-up, input enable, output disable (datasheet 2.19.6.3).
const PAD_PULL_DOWN: u32 = 2;
const PAD_PULL_UP: u32 = 3;
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
        for (name, pin, role) in [("a TX", self.tx, 0), ("an RX", self.rx, 1)] {
            let owner = usize::from(matches!(pin / 4, 1 | 2 | 5 | 6));
            assert!(
                pin < PINS && pin % 4 == role && owner == uart,
                "GPIO{pin} is not {name} pin of UART{uart}"
            );
        }
    }
}

/// Which ends of the wire lead to the UART as the pin multiplexers and pads are set.
pub fn uart_connection(chip: &Chip, uart: usize, pins: UartPins) -> PinConnection {
    pins.check(uart);
    let is_uart = |pin| chip.io_bank0.funcsel(pin) == FUNCTION_UART;
    let pad = |pin: usize| chip.pads_bank0.pads[pin];
    PinConnection {
        tx: is_uart(pins.tx) && !bit(pad(pins.tx), PAD_OUTPUT_DISABLE),
        rx: is_uart(pins.rx) && bit(pad(pins.rx), PAD_INPUT_ENABLE),
        rx_pull: pull(pad(pins.rx)),
    }
}

/// Both at once are a bus keeper (2.19.4); a line that something drives later is not tested.
fn pull(pad: u32) -> Pull {
    match (bit(pad, PAD_PULL_UP), bit(pad, PAD_PULL_DOWN)) {
        (true, _) => Pull::Up,
        (false, true) => Pull::Down,
        (false, false) => Pull::None,
    }
}

/// The two pins a test's I2C bus is soldered to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct I2cPins {
    pub sda: usize,
    pub scl: usize,
}

impl I2cPins {
    pub const DEFAULTS: [Self; 2] = [Self { sda: 4, scl: 5 }, Self { sda: 14, scl: 15 }];

    /// Function 3 gives pins to I2C0 and I2C1 by turns of two, SDA first.
    pub fn check(self, i2c: usize) {
        for (name, pin, role) in [("SDA", self.sda, 0), ("SCL", self.scl, 1)] {
            assert!(
                pin < PINS && pin % 2 == role && pin / 2 % 2 == i2c,
                "GPIO{pin} is not an {name} pin of I2C{i2c}"
            );
        }
    }
}

/// Whether both lines lead to the I2C block, in both ways.
pub fn i2c_connection(chip: &Chip, pins: I2cPins) -> bool {
    [pins.sda, pins.scl].into_iter().all(|pin| {
        let pad = chip.pads_bank0.pads[pin];
        let is_open = bit(pad, PAD_INPUT_ENABLE) && !bit(pad, PAD_OUTPUT_DISABLE);
        chip.io_bank0.funcsel(pin) == FUNCTION_I2C && is_open
    })
}

/// The three pins a test's SPI1 wires are soldered to, as the chip names them. Select pins are SIO's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpiPins {
    pub sck: usize,
    pub tx: usize,
    pub rx: usize,
}

impl SpiPins {
    pub const DEFAULT: Self = Self {
        sck: 10,
        tx: 11,
        rx: 12,
    };

    /// Function 1 gives eight pins each to SPI0 and SPI1 by turns: in fours of RX, select, SCK, TX.
    pub fn check(self) {
        for (name, pin, role) in [
            ("an RX", self.rx, 0),
            ("an SCK", self.sck, 2),
            ("a TX", self.tx, 3),
        ] {
            assert!(
                pin < PINS && pin / 8 % 2 == 1 && pin % 4 == role,
                "GPIO{pin} is not {name} pin of SPI1"
            );
        }
    }
}

/// Which ends of the wires lead to the SPI block.
pub fn spi_connection(chip: &Chip, pins: SpiPins) -> SpiConnection {
    let is_spi = |pin: usize| chip.io_bank0.funcsel(pin) == FUNCTION_SPI;
    let pad = |pin: usize, number| bit(chip.pads_bank0.pads[pin], number);
    let leaves = |pin| is_spi(pin) && !pad(pin, PAD_OUTPUT_DISABLE);
    SpiConnection {
        sck: leaves(pins.sck),
        tx: leaves(pins.tx),
        rx: is_spi(pins.rx) && pad(pins.rx, PAD_INPUT_ENABLE),
    }
}

/// How the pin multiplexers and the pads are set: sets of pins, one bit each.
#[derive(Clone, Copy, Debug, Default)]
pub struct PinSettings {
    /// SIO decides whether they are driven.
    pub sio_outputs: u32,
    /// Nothing but SIO could drive them, and no pull holds them.
    pub may_float: u32,
    pub pulled_up: u32,
    pub pulled_down: u32,
    pub input_enabled: u32,
    /// PIO0 decides whether they are driven.
    pub pio0_outputs: u32,
}

impl PinSettings {
    pub fn of(chip: &Chip) -> Self {
        let pad = |pin: usize, number| bit(chip.pads_bank0.pads[pin], number);
        let is_output = |pin| chip.io_bank0.funcsel(pin) == FUNCTION_SIO && !pad(pin, PAD_OUTPUT_DISABLE);
        Self {
            sio_outputs: pins_that(is_output),
            may_float: pins_that(|pin| {
                chip.io_bank0.funcsel(pin) == FUNCTION_SIO && pull(chip.pads_bank0.pads[pin]) == Pull::None
            }),
            pulled_up: pins_that(|pin| pad(pin, PAD_PULL_UP)),
            pulled_down: pins_that(|pin| pad(pin, PAD_PULL_DOWN)),
            input_enabled: pins_that(|pin| pad(pin, PAD_INPUT_ENABLE)),
            pio0_outputs: pins_that(|pin| pio_of(chip, pin) == Some(0)),
        }
    }
}

fn pins_that(condition: impl Fn(usize) -> bool) -> u32 {
    (0..PINS).fold(0, |pins, pin| pins | u32::from(condition(pin)) << pin)
}

/// What drives a pin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PinDrive {
    /// Nothing in the chip: it is what is connected to it that decides.
    Nothing,
    /// The processor through SIO, or a PIO block.
    Level(bool),
    Pwm(PwmOutput),
}

/// What drives a pin as the pin multiplexer and the pad are set.
pub fn pin_drive(chip: &Chip, soc: &Soc, pin: usize, now: Cycle) -> PinDrive {
    let is_output = bit(chip.sio.gpio_oe, pin as u32);
    match chip.io_bank0.funcsel(pin) {
        _ if bit(chip.pads_bank0.pads[pin], PAD_OUTPUT_DISABLE) => PinDrive::Nothing,
        FUNCTION_PWM => PinDrive::Pwm(soc.pwm.output(pin, now)),
        FUNCTION_SIO if is_output => PinDrive::Level(bit(chip.sio.gpio_out, pin as u32)),
        FUNCTION_PIO0 => level_drive(soc.pios[0].level(pin)),
        FUNCTION_PIO1 => level_drive(soc.pios[1].level(pin)),
        _ => PinDrive::Nothing,
    }
}

/// What a pin is driven to as long as no register is written. Nothing is low: the inputs of bridges have pull-downs.
fn pin_signal(chip: &Chip, soc: &Soc, pin: usize, now: Cycle) -> PinSignal {
    match pin_drive(chip, soc, pin, now) {
        PinDrive::Nothing => PinSignal::Level(false),
        PinDrive::Level(level) => PinSignal::Level(level),
        PinDrive::Pwm(_) => {
            let (slice, channel) = soc.pwm.slice_of(pin);
            PinSignal::Pwm { slice, channel }
        }
    }
}

/// What drives a pin that may be driven to a level.
pub fn level_drive(level: Option<bool>) -> PinDrive {
    level.map_or(PinDrive::Nothing, PinDrive::Level)
}

/// The PIO block to which a pin leads.
pub fn pio_of(chip: &Chip, pin: usize) -> Option<usize> {
    match chip.io_bank0.funcsel(pin) {
        _ if bit(chip.pads_bank0.pads[pin], PAD_OUTPUT_DISABLE) => None,
        FUNCTION_PIO0 => Some(0),
        FUNCTION_PIO1 => Some(1),
        _ => None,
    }
}

/// The level a pin is driven to at a moment; `None` when nothing in the chip drives it.
pub fn driven_level(chip: &Chip, soc: &Soc, pin: usize, now: Cycle) -> Option<bool> {
    match pin_drive(chip, soc, pin, now) {
        PinDrive::Nothing => None,
        PinDrive::Level(level) => Some(level),
        PinDrive::Pwm(_) => Some(soc.pwm.level(pin, now)),
    }
}

impl SystemBus {
    /// To be called whenever a pin may have changed: the processor can move the lines of an I2C bus.
    pub(super) fn observe_i2c_lines(&mut self) {
        let level = |pin| driven_level(&self.chip, &self.soc, pin, self.now).unwrap_or(true);
        let lines = self.i2c_pins.map(|pins| Levels {
            scl: level(pins.scl),
            sda: level(pins.sda),
        });
        for (i2c, levels) in self.soc.i2cs.iter_mut().zip(lines) {
            i2c.drive_by_hand(levels);
        }
    }

    pub(super) fn attach_circuit(&mut self, mut circuit: Circuit) {
        circuit.begin(self.now);
        self.soc.adc.circuit = Some(Box::new(circuit));
        self.observe_circuit();
    }

    /// To be called whenever a register was written on which the levels at pins depend.
    pub(super) fn observe_circuit(&mut self) {
        if self.soc.adc.circuit.is_none() {
            return;
        }
        // Until now it was as it was before.
        self.advance_stream();
        if let Some(mut circuit) = self.soc.adc.circuit.take() {
            circuit.advance(self.now);
            let signal = |pin| pin_signal(&self.chip, &self.soc, pin, self.now);
            circuit.connect_inputs(|pins| pins.map(signal));
            self.soc.adc.circuit = Some(circuit);
        }
    }

    /// To be called before devices are asked for anything.
    pub(super) fn show_circuit_to_devices(&mut self) {
        let has_devices = self.soc.i2cs.iter().any(I2c::has_devices);
        if self.soc.adc.circuit.is_none() || !has_devices {
            return;
        }
        self.advance_stream();
        if let Some(circuit) = &mut self.soc.adc.circuit {
            circuit.advance(self.now);
            self.soc.i2cs.iter_mut().for_each(|i2c| i2c.sense(circuit));
        }
    }

    /// To be called whenever a pin may have changed: the inputs and the select lines follow.
    pub(super) fn observe_inputs(&mut self) {
        let driven = self.chip.sio.gpio_oe & self.pin_settings.sio_outputs;
        let pads = PadState {
            driven,
            driven_high: driven & self.chip.sio.gpio_out,
            pulled_up: self.pin_settings.pulled_up,
            may_float: self.pin_settings.may_float,
            input_enabled: self.pin_settings.input_enabled,
        };
        self.soc
            .spi1
            .observe_selects(driven & !pads.driven_high, self.now);
        self.observe_wifi(pads);
        let bus = self.bus_lines();
        self.soc.gpio.set_pads(pads, bus);
        let levels = self.soc.gpio.levels();
        self.soc
            .pios
            .iter_mut()
            .for_each(|pio| pio.set_inputs(levels, self.now));
    }

    /// The radio's power, select and, with another driver than a PIO program, data and clock.
    fn observe_wifi(&mut self, pads: PadState) {
        let wiring = Wiring {
            sio: Outputs {
                high: pads.driven_high,
                driven: pads.driven,
            },
            pio: self.pin_settings.pio0_outputs,
            pulled_up: pads.pulled_up,
            pulled_down: self.pin_settings.pulled_down,
            input_enabled: pads.input_enabled,
        };
        if let Some(wifi) = &mut self.soc.wifi {
            wifi.set_wiring(wiring, self.now);
            let vsys = VsysConnection {
                is_connected: wifi.connects_vsys(),
                is_pulled_down: self.pin_settings.pulled_down & 1 << VSYS_PIN != 0,
            };
            if vsys != self.soc.adc.vsys() {
                self.advance_stream();
                self.soc.adc.connect_vsys(vsys);
            }
        }
    }

    /// When a pin that the processor waits for may change by what a UART receives.
    pub(super) fn next_change_for_processor(&self) -> Cycle {
        let waited_for = self.soc.gpio.watched();
        let uarts = self.soc.uarts.iter().zip(self.uart_pins);
        uarts
            .filter(|(_, pins)| bit(waited_for, pins.rx as u32))
            .map(|(uart, _)| uart.next_received_change(self.now))
            .min()
            .unwrap_or(NEVER)
    }

    fn bus_lines(&self) -> BusLevels {
        let mut lines = BusLevels::default();
        for (uart, pins) in self.soc.uarts.iter().zip(self.uart_pins) {
            if let Some(level) = uart.received_level(self.now) {
                lines.set(pins.rx, level);
            }
        }
        for (i2c, pins) in self.soc.i2cs.iter().zip(self.i2c_pins) {
            let Some(levels) = i2c.levels(self.now) else {
                continue;
            };
            for (pin, level) in [(pins.scl, levels.scl), (pins.sda, levels.sda)] {
                lines.set(pin, level);
            }
        }
        for (pin, level) in self.soc.spi1.interrupt_levels() {
            lines.set(pin, level);
        }
        if let Some(level) = self.soc.wifi.as_ref().and_then(|wifi| wifi.data_line()) {
            lines.set(DATA, level);
        }
        lines
    }

    /// To be called before SIO's GPIO_IN is read.
    pub(super) fn sample_inputs(&mut self) {
        self.soc.gpio.advance(self.now);
        self.observe_inputs();
        self.chip.sio.gpio_in = self.soc.gpio.levels();
    }
}
