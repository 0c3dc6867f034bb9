//! The SPI bus for a power monitor.

use embassy_rp::Peri;
use embassy_rp::gpio::{Level, Output};
use embassy_rp::peripherals::{PIN_10, PIN_11, PIN_12, PIN_22, SPI1};
use embassy_rp::spi::{Blocking, Config, Error, Phase, Polarity, Spi};
use embedded_hal_async::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

/// A register of an INA239 takes 40 µs. It stands ten times that clock; wires to a module may not.
const CLOCK_HZ: u32 = 1_000_000;

/// What the bus is made of.
pub struct SpiPeripherals {
    /// The peripheral.
    pub spi: Peri<'static, SPI1>,
    /// Clock.
    pub clock: Peri<'static, PIN_10>,
    /// To the part.
    pub to_part: Peri<'static, PIN_11>,
    /// From the part.
    pub from_part: Peri<'static, PIN_12>,
    /// Chip select, active low; `None` if the pin has another purpose, so that no part can be read.
    pub select: Option<Peri<'static, PIN_22>>,
}

/// SPI1 in mode 1. The pins stay untouched until the bus is used: the kit's line sensors are on three of them.
pub struct SensorSpi {
    /// `None` once it runs.
    peripherals: Option<SpiPeripherals>,
    running: Option<Running>,
}

struct Running {
    spi: Spi<'static, SPI1, Blocking>,
    select: Output<'static>,
}

impl SensorSpi {
    /// The bus on these pins.
    pub fn new(peripherals: SpiPeripherals) -> Self {
        Self {
            peripherals: Some(peripherals),
            running: None,
        }
    }

    fn running(&mut self) -> Result<&mut Running, ErrorKind> {
        if let Some(peripherals) = self.peripherals.take() {
            self.running = Running::start(peripherals);
        }
        self.running.as_mut().ok_or(ErrorKind::Other)
    }
}

impl Running {
    fn start(peripherals: SpiPeripherals) -> Option<Self> {
        let SpiPeripherals {
            spi,
            clock,
            to_part,
            from_part,
            select,
        } = peripherals;
        let select = Output::new(select?, Level::High);
        let mut config = Config::default();
        config.frequency = CLOCK_HZ;
        config.polarity = Polarity::IdleLow;
        config.phase = Phase::CaptureOnSecondTransition;
        Some(Self {
            spi: Spi::new_blocking(spi, clock, to_part, from_part, config),
            select,
        })
    }

    fn transfer(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Error> {
        for operation in operations {
            match operation {
                Operation::Read(bytes) => self.spi.blocking_read(bytes)?,
                Operation::Write(bytes) => self.spi.blocking_write(bytes)?,
                Operation::Transfer(read, written) => self.spi.blocking_transfer(read, written)?,
                Operation::TransferInPlace(bytes) => self.spi.blocking_transfer_in_place(bytes)?,
                Operation::DelayNs(_) => {}
            }
        }
        self.spi.flush()
    }
}

impl ErrorType for SensorSpi {
    type Error = ErrorKind;
}

impl SpiDevice for SensorSpi {
    /// A transfer takes some 40 µs, less than it would to wait for it.
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let running = self.running()?;
        running.select.set_low();
        let result = running.transfer(operations);
        running.select.set_high();
        result.map_err(|_| ErrorKind::Other)
    }
}
