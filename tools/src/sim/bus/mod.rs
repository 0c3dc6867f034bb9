//! Simulated I2C bus with a power monitor and a smart battery, which measure the simulated pack.

mod devices;

use embassy_time::{Duration, Timer};
use embedded_hal_async::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};

use self::devices::{Device, PowerMonitor, SmartBattery};
use super::PackSimulation;
use super::pack_simulation::Fault;

pub use self::devices::{POWER_MONITOR_ADDRESS, SHUNT_OHM, SMART_BATTERY_ADDRESS};

/// Bit time at SMBus's 100 kHz.
const CLOCK: Duration = Duration::from_micros(10);

/// Duration of a START, RESTART or STOP.
const CONDITION_CLOCKS: usize = 1;

/// Eight bits and the acknowledge bit.
const BYTE_CLOCKS: usize = 9;

/// Nothing acknowledges the address.
const NO_DEVICE: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);

/// Bus with an INA226 and a smart battery. A transfer takes the time of its bits.
pub struct SimulatedBus<'a> {
    pack: &'a PackSimulation<'a>,
    power_monitor: PowerMonitor,
    smart_battery: SmartBattery,
}

impl<'a> SimulatedBus<'a> {
    /// A bus whose devices measure `pack`.
    pub fn new(pack: &'a PackSimulation<'a>) -> Self {
        Self {
            pack,
            power_monitor: PowerMonitor::new(),
            smart_battery: SmartBattery::new(),
        }
    }

    fn device(&mut self, address: u8) -> Result<&mut dyn Device, ErrorKind> {
        match address {
            _ if self.pack.fault() == Fault::BusOff => Err(NO_DEVICE),
            POWER_MONITOR_ADDRESS => Ok(&mut self.power_monitor),
            // Its electronics are in the pack.
            SMART_BATTERY_ADDRESS if self.pack.now().is_plugged_in() => Ok(&mut self.smart_battery),
            _ => Err(NO_DEVICE),
        }
    }

    /// From the START to the last byte before the STOP.
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        // Whether bytes are read or written after the address.
        let mut under_way = None;
        for operation in operations {
            let is_read = matches!(operation, Operation::Read(_));
            if under_way.replace(is_read) != Some(is_read) {
                self.start(address, is_read).await?;
            }
            let pack = self.pack;
            exchange(self.device(address)?, pack, operation).await?;
        }
        Ok(())
    }

    /// A START or RESTART, and the address.
    async fn start(&mut self, address: u8, is_read: bool) -> Result<(), ErrorKind> {
        clocks(CONDITION_CLOCKS + BYTE_CLOCKS).await;
        let pack = self.pack;
        let device = self.device(address)?;
        if is_read {
            device.start_read(&pack.now());
        } else {
            device.start_write();
        }
        Ok(())
    }
}

async fn exchange(
    device: &mut dyn Device,
    pack: &PackSimulation<'_>,
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
