//! The peripherals of the chip that are modelled here, and the wires between them.

use super::adc::Adc;
use super::chip_reset::{ChipLevelReset, ChipReset};
use super::clock::{Cycle, NEVER};
use super::cyw43::Cyw43;
use super::dma::Dma;
use super::flash::FlashMake;
use super::floating::Floating;
use super::gpio::Gpio;
use super::i2c::{I2c, I2cPlace};
use super::memory_map::{BLOCKS, Model};
use super::peripheral::Peripheral;
use super::pio::{PinDevice, Pio, PioPlace};
use super::power_state::PowerState;
use super::pwm::Pwm;
use super::register::{RegisterWrite, bit};
use super::spi::{Spi, SpiPlace};
use super::ssi::Ssi;
use super::timer::Timer;
use super::uart::{Line, Uart, UartPlace};
use super::usb::Usb;
use super::watchdog::Watchdog;
use super::xip_control::XipControl;

/// Names one peripheral model in the address map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Id {
    PowerState,
    Gpio,
    Uart0,
    Uart1,
    I2c0,
    I2c1,
    Spi1,
    Adc,
    Pwm,
    Timer,
    Watchdog,
    ChipReset,
    Dma,
    XipControl,
    Ssi,
    Pio0,
    Pio1,
    Usb,
}

/// Interrupt lines from datasheet 2.3.2, DMA requests from 2.5.3.1.
fn uart_place(number: u32) -> UartPlace {
    UartPlace {
        interrupt_line: 20 + number,
        dma_request_tx: 20 + 2 * number,
        dma_request_rx: 21 + 2 * number,
    }
}

fn i2c_place(number: u32) -> I2cPlace {
    I2cPlace {
        interrupt_line: 23 + number,
        dma_request_tx: 32 + 2 * number,
        dma_request_rx: 33 + 2 * number,
    }
}

fn pio_place(number: u32) -> PioPlace {
    PioPlace {
        interrupt_line: 7 + 2 * number,
        dma_request: 8 * number,
    }
}

const SPI1_PLACE: SpiPlace = SpiPlace {
    interrupt_line: 19,
    dma_request_tx: 18,
    dma_request_rx: 19,
};

#[derive(Clone)]
pub struct Soc {
    pub power_state: PowerState,
    pub gpio: Gpio,
    pub uarts: [Uart; 2],
    pub i2cs: [I2c; 2],
    pub spi1: Spi,
    pub adc: Adc,
    pub pwm: Pwm,
    pub timer: Timer,
    pub watchdog: Watchdog,
    pub chip_reset: ChipReset,
    pub dma: Dma,
    pub xip_control: XipControl,
    pub ssi: Ssi,
    pub pios: [Pio; 2],
    pub usb: Usb,
    /// What makes the board a Pico W, at pins of PIO0.
    pub wifi: Option<Box<Cyw43>>,
}

/// Does the same with every peripheral but the converter, each by its own type: most of them have nothing to do, and cost nothing
/// then. What the converter does is a matter of [`super::stream`].
macro_rules! with_each {
    ($soc:ident, $($borrow:tt)+) => { with_each!(@split $soc, $($borrow)+) };
    (@split $soc:ident, ref $p:ident => $what:expr) => {
        with_each!(@list $soc, $p, (&) , $what)
    };
    (@split $soc:ident, mut $p:ident => $what:expr) => {
        with_each!(@list $soc, $p, (&mut) , $what)
    };
    (@list $soc:ident, $p:ident, ($($b:tt)+), $what:expr) => {
        with_each!(@do $p, ($($b)+), $what,
            $soc.power_state, $soc.gpio, $soc.uarts[0], $soc.uarts[1], $soc.i2cs[0], $soc.i2cs[1], $soc.spi1,
            $soc.pwm, $soc.timer, $soc.watchdog, $soc.chip_reset, $soc.dma, $soc.xip_control, $soc.ssi, $soc.pios[0],
            $soc.pios[1], $soc.usb)
    };
    (@do $p:ident, $b:tt, $what:expr, $($place:expr),*) => {
        $(with_each!(@one $p, $b, $what, $place);)*
    };
    (@one $p:ident, (&), $what:expr, $place:expr) => {{ let $p = &$place; $what; }};
    (@one $p:ident, (&mut), $what:expr, $place:expr) => {{ let $p = &mut $place; $what; }};
}

impl Soc {
    pub fn new(noise_seed: u64) -> Self {
        let noise = Floating::new(noise_seed);
        Self {
            power_state: PowerState::default(),
            gpio: Gpio::new(noise),
            uarts: [0, 1].map(|number| Uart::new(uart_place(number as u32), Line::new(noise, number))),
            i2cs: [0, 1].map(|number| I2c::new(i2c_place(number))),
            spi1: Spi::new(SPI1_PLACE),
            adc: Adc::new(noise_seed),
            pwm: Pwm::new(),
            timer: Timer::default(),
            watchdog: Watchdog::new(),
            chip_reset: ChipReset::after(ChipLevelReset::PowerOn),
            dma: Dma::new(),
            xip_control: XipControl::default(),
            ssi: Ssi::new(FlashMake::w25q16jv([0; 8])),
            pios: [0, 1].map(|number| Pio::new(pio_place(number))),
            usb: Usb::new(),
            wifi: None,
        }
    }

    fn get(&mut self, id: Id) -> &mut dyn Peripheral {
        match id {
            Id::PowerState => &mut self.power_state,
            Id::Gpio => &mut self.gpio,
            Id::Uart0 => &mut self.uarts[0],
            Id::Uart1 => &mut self.uarts[1],
            Id::I2c0 => &mut self.i2cs[0],
            Id::I2c1 => &mut self.i2cs[1],
            Id::Spi1 => &mut self.spi1,
            Id::Adc => &mut self.adc,
            Id::Pwm => &mut self.pwm,
            Id::Timer => &mut self.timer,
            Id::Watchdog => &mut self.watchdog,
            Id::ChipReset => &mut self.chip_reset,
            Id::Dma => &mut self.dma,
            Id::XipControl => &mut self.xip_control,
            Id::Ssi => &mut self.ssi,
            Id::Pio0 => &mut self.pios[0],
            Id::Pio1 => &mut self.pios[1],
            Id::Usb => &mut self.usb,
        }
    }

    /// PIO0 and the radio at its pins, cycle by cycle.
    pub fn advance_wifi(&mut self, now: Cycle) {
        if let Some(wifi) = &mut self.wifi {
            self.pios[0].advance_with(wifi.as_mut(), now);
        }
    }

    pub fn read(&mut self, id: Id, offset: u32, now: Cycle) -> u32 {
        self.advance_wifi_before(id, now);
        let peripheral = self.get(id);
        peripheral.advance(now);
        peripheral.read(offset, now)
    }

    fn advance_wifi_before(&mut self, id: Id, now: Cycle) {
        if id == Id::Pio0 {
            self.advance_wifi(now);
        }
    }

    pub fn write(&mut self, id: Id, offset: u32, write: RegisterWrite, now: Cycle) {
        self.advance_wifi_before(id, now);
        let peripheral = self.get(id);
        peripheral.advance(now);
        peripheral.write(offset, write, now);
        peripheral.advance(now);
        self.advance_wifi_before(id, now);
        self.timer.set_tick(self.watchdog.tick(), now);
        if id == Id::Ssi {
            self.flash_is_set_up();
        }
    }

    /// The interface to the flash chip may have been set up for other reads, which take another time.
    fn flash_is_set_up(&mut self) {
        if let Some(cycles) = self.ssi.line_cycles() {
            self.xip_control.cache.set_line_cycles(cycles);
        }
    }

    /// Sets up the interface to the flash chip, without a program that does.
    pub fn set_up_flash(&mut self, set_up: fn(&mut Ssi, Cycle), now: Cycle) {
        set_up(&mut self.ssi, now);
        self.flash_is_set_up();
    }

    /// RESETS has changed: blocks that are or were held come out of it in their reset state.
    pub fn hold_in_reset(&mut self, held_before: u32, held_now: u32, now: Cycle) {
        for block in &BLOCKS {
            if let (Model::Own(id), Some(reset_bit)) = (block.model, block.reset_bit)
                && bit(held_before | held_now, reset_bit)
            {
                self.get(id).reset(now);
            }
        }
    }

    /// A reset of everything.
    pub fn reset(&mut self, now: Cycle) {
        with_each!(self, mut peripheral => peripheral.reset(now));
        self.adc.reset(now);
        self.timer.set_tick(self.watchdog.tick(), now);
    }

    /// All but the converter.
    pub fn advance(&mut self, now: Cycle) {
        self.advance_wifi(now);
        with_each!(self, mut peripheral => peripheral.advance(now));
    }

    /// Of all but the converter.
    pub fn next_event(&self) -> Cycle {
        let wifi = self.wifi.as_ref().map_or(NEVER, |wifi| wifi.next_event());
        let mut next = wifi;
        with_each!(self, ref peripheral => next = next.min(peripheral.next_event()));
        next
    }

    pub fn interrupt_lines(&self) -> u32 {
        let mut lines = self.adc.interrupt_lines();
        with_each!(self, ref peripheral => lines |= peripheral.interrupt_lines());
        lines
    }

    pub fn dma_requests(&self) -> u64 {
        let mut requests = self.adc.dma_requests();
        with_each!(self, ref peripheral => requests |= peripheral.dma_requests());
        requests
    }
}
