//! The I2C bus for power monitors and smart batteries.

use embassy_rp::Peri;
use embassy_rp::gpio::{Level, OutputOpenDrain};
use embassy_rp::i2c::{AbortReason, Async, Config, Error, I2c};
use embassy_rp::pac;
use embassy_rp::peripherals::{I2C1, PIN_14, PIN_15};
use embassy_time::{Duration, Timer, with_timeout};
use embedded_hal_async::i2c::{I2c as _, Operation};

use super::Irqs;
use crate::battery::BusError;
use crate::log::warn;
use crate::sensor::I2cBus;

/// SMBus lets a device hold the clock for 25 ms and has it give up after 35 ms (T_TIMEOUT).
const TIMEOUT: Duration = Duration::from_millis(35);

/// A device that waits for the rest of a byte releases SDA within this many clocks (I2C specification UM10204, 3.1.16).
const RECOVERY_CLOCKS: usize = 9;

/// 100 kHz, which every device stands.
const HALF_CLOCK: Duration = Duration::from_micros(5);

/// Until a line is high that only the chip's own pull-up lifts: 80 kΩ at most, and the 400 pF of the longest bus.
const RISE_TIME: Duration = Duration::from_micros(100);

const SDA: u32 = 1 << 14;
const SCL: u32 = 1 << 15;

/// `TX_ABRT_SOURCE`: a byte was not acknowledged (RP2040 datasheet, IC_TX_ABRT_SOURCE).
const DATA_NOT_ACKNOWLEDGED: u32 = 1 << 3;

/// I2C1, SDA on GP14 and SCL on GP15. The pins stay untouched until the bus is used.
///
/// Every transfer ends: after a time-out the bus is freed as far as that is possible, and the peripheral starts over, since
/// an abandoned transfer leaves it in the middle.
pub struct SensorI2c {
    peripheral: Peri<'static, I2C1>,
    sda: Peri<'static, PIN_14>,
    scl: Peri<'static, PIN_15>,
    config: Config,
    /// `None` before the first transfer and after an abandoned one.
    driver: Option<I2c<'static, I2C1, Async>>,
}

impl SensorI2c {
    /// The bus, with a clock of `clock_hz`.
    pub fn new(
        peripheral: Peri<'static, I2C1>,
        sda: Peri<'static, PIN_14>,
        scl: Peri<'static, PIN_15>,
        clock_hz: u32,
    ) -> Self {
        let mut config = Config::default();
        config.frequency = clock_hz;
        Self {
            peripheral,
            sda,
            scl,
            config,
            driver: None,
        }
    }

    /// Clocks until no part holds SDA, then a STOP.
    async fn free(&mut self) {
        self.driver = None;
        let mut scl = OutputOpenDrain::new(self.scl.reborrow(), Level::High);
        let mut sda = OutputOpenDrain::new(self.sda.reborrow(), Level::High);
        scl.set_pullup(true);
        sda.set_pullup(true);
        for _ in 0..RECOVERY_CLOCKS {
            if sda.is_high() {
                break;
            }
            scl.set_low();
            Timer::after(HALF_CLOCK).await;
            scl.set_high();
            Timer::after(HALF_CLOCK).await;
        }
        sda.set_low();
        Timer::after(HALF_CLOCK).await;
        sda.set_high();
        Timer::after(HALF_CLOCK).await;
    }

    /// Makes sure that both lines are free.
    async fn ready(&mut self) -> Result<&mut I2c<'static, I2C1, Async>, BusError> {
        if self.driver.is_some() && !is_free() {
            self.free().await;
        }
        let driver = self.driver.get_or_insert_with(|| {
            // SAFETY: the driver that is made here is the only one: the one before was dropped when `driver` became `None`,
            // and `free` uses the pins only after it has made it `None`.
            #[allow(unsafe_code)]
            let (peripheral, sda, scl) = unsafe {
                (
                    self.peripheral.clone_unchecked(),
                    self.sda.clone_unchecked(),
                    self.scl.clone_unchecked(),
                )
            };
            I2c::new_async(peripheral, scl, sda, Irqs, self.config)
        });
        if !is_free() {
            // The driver has just turned the pull-ups on.
            Timer::after(RISE_TIME).await;
        }
        is_free().then_some(driver).ok_or(BusError::Stuck)
    }
}

/// Whether no part holds a line low; between transfers the pull-ups keep them high.
fn is_free() -> bool {
    let lines = pac::SIO.gpio_in(0).read() & (SDA | SCL);
    lines == SDA | SCL
}

impl I2cBus for SensorI2c {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let driver = self.ready().await?;
        match with_timeout(TIMEOUT, driver.transaction(address, operations)).await {
            Ok(result) => result.map_err(bus_error),
            Err(_) => {
                warn!("I2C1: {:#x} did not finish, the bus is freed", address);
                self.free().await;
                Err(BusError::Timeout)
            }
        }
    }
}

fn bus_error(error: Error) -> BusError {
    match error {
        Error::Abort(AbortReason::NoAcknowledge) => BusError::NoAnswer,
        Error::Abort(AbortReason::Other(source)) if source & DATA_NOT_ACKNOWLEDGED != 0 => BusError::NoAnswer,
        _ => BusError::Transfer,
    }
}
