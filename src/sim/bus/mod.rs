//! The board's I2C bus, with a power monitor and a smart battery on it that measure the simulated pack.

mod power_monitor;
mod smart_battery;

use embassy_time::{Duration, Timer};
use embedded_hal_async::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};

use self::power_monitor::PowerMonitor;
use self::smart_battery::SmartBattery;
use super::{LivingPack, SimulatedPack};

pub use self::power_monitor::{ADDRESS as POWER_MONITOR_ADDRESS, SHUNT_OHM};
pub use self::smart_battery::ADDRESS as SMART_BATTERY_ADDRESS;

/// At the 100 kHz of SMBus.
const CLOCK: Duration = Duration::from_micros(10);

/// A START, a RESTART or a STOP takes about as long as a bit.
const CONDITION_CLOCKS: usize = 1;

/// Eight bits and the acknowledgement.
const BYTE_CLOCKS: usize = 9;

/// What a device has to do between a START and the STOP.
trait Device {
    /// It was addressed to be written to.
    fn start_write(&mut self);

    /// Takes a byte.
    ///
    /// # Errors
    /// It does not acknowledge it.
    fn write(&mut self, byte: u8, pack: &SimulatedPack) -> Result<(), ErrorKind>;

    /// It was addressed to be read from, with the pack as it is at that moment.
    fn start_read(&mut self, pack: &SimulatedPack);

    /// Gives a byte.
    fn read(&mut self) -> u8;
}

/// Who sends the bytes after the address.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Write,
    Read,
}

impl Direction {
    fn of(operation: &Operation<'_>) -> Self {
        match operation {
            Operation::Write(_) => Self::Write,
            Operation::Read(_) => Self::Read,
        }
    }
}

/// An INA226 and a smart battery. A transfer takes the time of its bits.
pub struct SimulatedBus<'a> {
    pack: &'a LivingPack<'a>,
    power_monitor: PowerMonitor,
    smart_battery: SmartBattery,
}

impl<'a> SimulatedBus<'a> {
    /// A bus whose devices measure `pack`.
    pub fn new(pack: &'a LivingPack<'a>) -> Self {
        Self {
            pack,
            power_monitor: PowerMonitor::new(),
            smart_battery: SmartBattery::new(),
        }
    }

    fn device(&mut self, address: u8) -> Result<&mut dyn Device, ErrorKind> {
        match address {
            POWER_MONITOR_ADDRESS => Ok(&mut self.power_monitor),
            SMART_BATTERY_ADDRESS => Ok(&mut self.smart_battery),
            _ => Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)),
        }
    }

    /// From the START to before the STOP.
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        let mut under_way = None;
        for operation in operations {
            let direction = Direction::of(operation);
            if under_way.replace(direction) != Some(direction) {
                self.start(address, direction).await?;
            }
            let pack = self.pack;
            exchange(self.device(address)?, pack, operation).await?;
        }
        Ok(())
    }

    /// A START or RESTART, and the address.
    async fn start(&mut self, address: u8, direction: Direction) -> Result<(), ErrorKind> {
        clocks(CONDITION_CLOCKS + BYTE_CLOCKS).await;
        let pack = self.pack;
        let device = self.device(address)?;
        match direction {
            Direction::Write => device.start_write(),
            Direction::Read => device.start_read(&pack.now()),
        }
        Ok(())
    }
}

async fn exchange(
    device: &mut dyn Device,
    pack: &LivingPack<'_>,
    operation: &mut Operation<'_>,
) -> Result<(), ErrorKind> {
    match operation {
        Operation::Write(bytes) => {
            for byte in bytes.iter() {
                clocks(BYTE_CLOCKS).await;
                device.write(*byte, &pack.now())?;
            }
        }
        Operation::Read(buffer) => {
            clocks(buffer.len() * BYTE_CLOCKS).await;
            buffer.fill_with(|| device.read());
        }
    }
    Ok(())
}

async fn clocks(count: usize) {
    Timer::after(CLOCK * count as u32).await;
}

impl ErrorType for SimulatedBus<'_> {
    type Error = ErrorKind;
}

impl I2c for SimulatedBus<'_> {
    async fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        let result = self.transfer(address, operations).await;
        clocks(CONDITION_CLOCKS).await;
        result
    }
}

#[cfg(test)]
mod tests;
