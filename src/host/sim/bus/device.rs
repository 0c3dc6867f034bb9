//! What a simulated bus expects of a device.

use embedded_hal_async::i2c::ErrorKind;

use crate::host::sim::SimulatedPack;

/// A device on the bus.
pub(super) trait Device {
    /// It was addressed for writing.
    fn start_write(&mut self);

    /// Receives a byte.
    ///
    /// # Errors
    /// The byte is not acknowledged.
    fn write(&mut self, byte: u8, pack: &SimulatedPack) -> Result<(), ErrorKind>;

    /// It was addressed for reading, with the present state of the pack.
    fn start_read(&mut self, pack: &SimulatedPack);

    /// Sends a byte.
    fn read(&mut self) -> u8;
}
