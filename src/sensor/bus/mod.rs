//! Packs that are measured by parts on the I2C bus, or on the SPI bus.
//!
//! A part is one file in `parts/` and one line in `registry.rs`; `docs/extending.md` shows how.

mod devices;
mod part;
mod parts;
mod registers;
mod registry;
mod samples;
mod smbus;

#[cfg(test)]
mod tests;

use embedded_hal_async::i2c::{Error, ErrorKind, I2c, Operation};
use embedded_hal_async::spi::{
    ErrorKind as SpiErrorKind, ErrorType as SpiErrorType, Operation as SpiOperation, SpiDevice,
};

pub use devices::{BusDevices, bus_clock_hz, part_address};
pub use part::Wiring;
pub use samples::Samples;

use crate::battery::BusError;

/// The address of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Address {
    /// At a 7-bit address of the I2C bus.
    I2c(u8),
    /// At the SPI bus, behind its one chip select.
    ChipSelect,
}

impl Address {
    /// The address a parameter names; `None` for 0.
    pub fn from_parameter(value: i32) -> Option<Self> {
        u8::try_from(value)
            .ok()
            .filter(|address| *address > 0)
            .map(Self::I2c)
    }
}

/// The wires to the parts. Transfers must end: the implementation bounds the wait and frees one that hangs.
pub trait SensorBus {
    /// Writes `written`, unless that is empty, then reads, without letting go in between.
    ///
    /// # Errors
    /// No part answers, or the transfer failed.
    // The futures stay on one executor, so `Send` need not be promised.
    #[allow(async_fn_in_trait)]
    async fn write_read(&mut self, address: Address, written: &[u8], read: &mut [u8])
    -> Result<(), BusError>;

    /// Writes.
    ///
    /// # Errors
    /// No part answers, or the transfer failed.
    #[allow(async_fn_in_trait)]
    async fn write(&mut self, address: Address, written: &[u8]) -> Result<(), BusError>;
}

/// An I2C bus: any of `embedded-hal-async`, or one that knows more of a failed transfer than an [`ErrorKind`] says, such as
/// a line that is held low or a transfer that timed out.
pub trait I2cBus {
    /// One transaction, as [`I2c::transaction`] has it.
    ///
    /// # Errors
    /// No device acknowledges the address, or the transfer failed.
    #[allow(async_fn_in_trait)]
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError>;
}

impl<B: I2c> I2cBus for B {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let transaction = self.transaction(address, operations).await;
        transaction.map_err(|error| bus_error(error.kind()))
    }
}

fn bus_error(kind: ErrorKind) -> BusError {
    match kind {
        ErrorKind::NoAcknowledge(_) => BusError::NoAnswer,
        _ => BusError::Transfer,
    }
}

/// An I2C bus, and an SPI bus with one chip select.
pub struct Buses<I, S> {
    /// The I2C bus.
    pub i2c: I,
    /// The SPI bus.
    pub spi: S,
}

/// A board without an SPI bus.
pub struct NoSpi;

impl<I> Buses<I, NoSpi> {
    /// An I2C bus alone.
    pub fn i2c(i2c: I) -> Self {
        Self { i2c, spi: NoSpi }
    }
}

impl<I: I2cBus, S: SpiDevice> SensorBus for Buses<I, S> {
    async fn write_read(
        &mut self,
        address: Address,
        written: &[u8],
        read: &mut [u8],
    ) -> Result<(), BusError> {
        match address {
            Address::I2c(address) if written.is_empty() => {
                self.i2c.transfer(address, &mut [Operation::Read(read)]).await
            }
            Address::I2c(address) => {
                let mut operations = [Operation::Write(written), Operation::Read(read)];
                self.i2c.transfer(address, &mut operations).await
            }
            Address::ChipSelect => {
                let mut operations = [SpiOperation::Write(written), SpiOperation::Read(read)];
                let transfer = self.spi.transaction(&mut operations);
                transfer.await.map_err(|_| BusError::Transfer)
            }
        }
    }

    async fn write(&mut self, address: Address, written: &[u8]) -> Result<(), BusError> {
        match address {
            Address::I2c(address) => self.i2c.transfer(address, &mut [Operation::Write(written)]).await,
            Address::ChipSelect => self.spi.write(written).await.map_err(|_| BusError::Transfer),
        }
    }
}

impl SpiErrorType for NoSpi {
    type Error = SpiErrorKind;
}

impl SpiDevice for NoSpi {
    async fn transaction(&mut self, _: &mut [SpiOperation<'_, u8>]) -> Result<(), SpiErrorKind> {
        Err(SpiErrorKind::Other)
    }
}
