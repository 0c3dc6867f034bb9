//! Parts with numbered registers, the highest byte first: Texas Instruments' power monitors.

use super::{Address, SensorBus};
use crate::battery::ReadError;

/// The registers of the part at an address.
pub(super) struct Registers<'a, B> {
    bus: &'a mut B,
    address: Address,
}

impl<'a, B: SensorBus> Registers<'a, B> {
    pub fn new(bus: &'a mut B, address: Address) -> Self {
        Self { bus, address }
    }

    /// A register of `N` bytes.
    pub async fn read<const N: usize>(&mut self, register: u8) -> Result<[u8; N], ReadError> {
        let mut bytes = [0; N];
        self.bus
            .write_read(self.address.bits(), &[register], &mut bytes)
            .await
            .map_err(Into::into)?;
        Ok(bytes)
    }

    pub async fn read_u16(&mut self, register: u8) -> Result<u16, ReadError> {
        self.read(register).await.map(u16::from_be_bytes)
    }

    pub async fn write_u16(&mut self, register: u8, value: u16) -> Result<(), ReadError> {
        let [high, low] = value.to_be_bytes();
        self.bus
            .write(self.address.bits(), &[register, high, low])
            .await
            .map_err(Into::into)
    }

    /// Makes sure that a register holds what was written there.
    ///
    /// # Errors
    /// [`ReadError::OtherPart`] if it does not.
    pub async fn expect_u16(&mut self, register: u8, value: u16) -> Result<(), ReadError> {
        if self.read_u16(register).await? == value {
            Ok(())
        } else {
            Err(ReadError::OtherPart)
        }
    }
}
