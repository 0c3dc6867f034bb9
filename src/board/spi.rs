//! The SPI bus for a power monitor and a CAN controller.

use core::cell::RefCell;

use embassy_rp::Peri;
use embassy_rp::gpio::{AnyPin, Level, Output};
use embassy_rp::peripherals::{PIN_10, PIN_11, PIN_12, SPI1};
use embassy_rp::spi::{Blocking, Config, Error, Phase, Polarity, Spi};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embedded_hal::spi::SpiDevice as BlockingSpiDevice;
use embedded_hal_async::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

/// A register of an INA239 takes 40 µs. It stands ten times that clock; wires to a module may not.
const MONITOR_HZ: u32 = 1_000_000;

/// A frame of an MCP2515 takes 14 µs. It stands 10 MHz (DS20001801, table 13-6); of what the processor's 125 MHz divide into,
/// this comes next: 7.8 MHz.
const CAN_HZ: u32 = 8_000_000;

/// Peripherals of the bus.
pub struct SpiPeripherals {
    /// The peripheral.
    pub spi: Peri<'static, SPI1>,
    /// Clock.
    pub clock: Peri<'static, PIN_10>,
    /// To the parts.
    pub to_part: Peri<'static, PIN_11>,
    /// From the parts.
    pub from_part: Peri<'static, PIN_12>,
}

/// SPI1, for parts with a clock of their own each. Its pins stay untouched until it is used: the kit's line sensors are on three
/// of them.
///
/// A transfer runs with interrupts off, 60 µs at most, since the CAN controller is served in an interrupt.
pub struct SharedSpi(Mutex<CriticalSectionRawMutex, RefCell<Bus>>);

struct Bus {
    /// `None` once it runs.
    peripherals: Option<SpiPeripherals>,
    running: Option<Running>,
}

struct Running {
    spi: Spi<'static, SPI1, Blocking>,
    clock: SpiClock,
}

/// The clock of a part. All are low at rest, so that it does not change while no part is selected.
#[derive(Clone, Copy, PartialEq, Eq)]
enum SpiClock {
    /// Mode 1, slow.
    Monitor,
    /// Mode 0, fast.
    Can,
}

impl SpiClock {
    fn config(self) -> Config {
        let (hz, phase) = match self {
            Self::Monitor => (MONITOR_HZ, Phase::CaptureOnSecondTransition),
            Self::Can => (CAN_HZ, Phase::CaptureOnFirstTransition),
        };
        let mut config = Config::default();
        config.frequency = hz;
        config.polarity = Polarity::IdleLow;
        config.phase = phase;
        config
    }
}

impl SharedSpi {
    /// The bus on these pins.
    pub fn new(peripherals: SpiPeripherals) -> Self {
        Self(Mutex::new(RefCell::new(Bus {
            peripherals: Some(peripherals),
            running: None,
        })))
    }

    // Inlined, it would be there for each instruction to a part.
    #[inline(never)]
    fn transfer(
        &self,
        clock: SpiClock,
        select: &mut Output<'static>,
        operations: &mut [Operation<'_, u8>],
    ) -> Result<(), ErrorKind> {
        self.0.lock(|bus| {
            let mut bus = bus.try_borrow_mut().map_err(|_| ErrorKind::Other)?;
            let running = bus.running(clock).ok_or(ErrorKind::Other)?;
            select.set_low();
            let result = running.transfer(operations);
            select.set_high();
            result.map_err(|_| ErrorKind::Other)
        })
    }
}

impl Bus {
    fn running(&mut self, clock: SpiClock) -> Option<&mut Running> {
        if let Some(peripherals) = self.peripherals.take() {
            self.running = Some(Running::start(peripherals, clock));
        }
        let running = self.running.as_mut()?;
        if running.clock != clock {
            running.spi.set_config(&clock.config());
            running.clock = clock;
        }
        Some(running)
    }
}

impl Running {
    fn start(peripherals: SpiPeripherals, clock: SpiClock) -> Self {
        let SpiPeripherals {
            spi,
            clock: clock_pin,
            to_part,
            from_part,
        } = peripherals;
        Self {
            spi: Spi::new_blocking(spi, clock_pin, to_part, from_part, clock.config()),
            clock,
        }
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

/// The power monitor on the bus.
pub struct SensorSpi {
    bus: &'static SharedSpi,
    select: Option<Output<'static>>,
}

impl SensorSpi {
    /// The monitor that is selected by a low level at `select`; `None` if there is none.
    pub fn new(bus: &'static SharedSpi, select: Option<Peri<'static, AnyPin>>) -> Self {
        Self {
            bus,
            // Before anything else is selected: an open line would select the monitor, too.
            select: select.map(|pin| Output::new(pin, Level::High)),
        }
    }
}

impl ErrorType for SensorSpi {
    type Error = ErrorKind;
}

impl SpiDevice for SensorSpi {
    /// A transfer takes some 40 µs, less than it would to wait for it.
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let select = self.select.as_mut().ok_or(ErrorKind::Other)?;
        self.bus.transfer(SpiClock::Monitor, select, operations)
    }
}

/// The CAN controller on the bus.
pub struct CanSpi {
    bus: &'static SharedSpi,
    select: Output<'static>,
}

impl CanSpi {
    /// The controller that is selected by a low level at `select`.
    pub(super) fn new(bus: &'static SharedSpi, select: Peri<'static, AnyPin>) -> Self {
        Self {
            bus,
            select: Output::new(select, Level::High),
        }
    }
}

impl ErrorType for CanSpi {
    type Error = ErrorKind;
}

impl BlockingSpiDevice for CanSpi {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.bus.transfer(SpiClock::Can, &mut self.select, operations)
    }
}
