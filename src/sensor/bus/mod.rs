//! Packs that are measured by parts on the I2C bus.
//!
//! A part is one file in `parts/` and one line in `registry.rs`; `docs/adding-a-sensor.md` shows how.

mod address;
mod devices;
mod part;
mod parts;
mod registers;
mod registry;
mod samples;
mod smbus;
mod wiring;

#[cfg(test)]
mod tests;

use embedded_hal_async::i2c::{Error, ErrorKind, I2c};

pub use address::Address;
pub use devices::{BusDevices, bus_clock_hz};
pub use registry::PartKind;
pub use samples::Samples;
pub use wiring::Wiring;

use crate::battery::ReadError;

/// An I2C bus that tells why a transfer failed. Transfers must end: whoever implements it bounds the wait and frees a bus
/// that hangs.
pub trait SensorBus: I2c<Error: Into<ReadError>> {}

impl<B: I2c<Error: Into<ReadError>>> SensorBus for B {}

impl Error for ReadError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NoAnswer => ErrorKind::NoAcknowledge(embedded_hal_async::i2c::NoAcknowledgeSource::Unknown),
            Self::BusStuck | Self::Bus => ErrorKind::Bus,
            _ => ErrorKind::Other,
        }
    }
}

impl From<ErrorKind> for ReadError {
    fn from(kind: ErrorKind) -> Self {
        match kind {
            ErrorKind::NoAcknowledge(_) => Self::NoAnswer,
            _ => Self::Bus,
        }
    }
}
