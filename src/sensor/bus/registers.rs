//! Parts with numbered registers, the highest byte first: Texas Instruments' power monitors.

use super::{Address, SensorBus};
use crate::battery::ReadError;

/// By SPI the first byte has the register from bit 2 on, and bit 0 says which way (INA239, SLYS027).
const SPI_REGISTER_SHIFT: u32 = 2;
const SPI_READ: u8 = 1;

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
        let command = match self.address {
            Address::I2c(_) => register,
            Address::ChipSelect => register << SPI_REGISTER_SHIFT | SPI_READ,
        };
        let mut bytes = [0; N];
        self.bus.write_read(self.address, &[command], &mut bytes).await?;
        Ok(bytes)
    }

    pub async fn read_u16(&mut self, register: u8) -> Result<u16, ReadError> {
        self.read(register).await.map(u16::from_be_bytes)
    }

    pub async fn write_u16(&mut self, register: u8, value: u16) -> Result<(), ReadError> {
        let command = match self.address {
            Address::I2c(_) => register,
            Address::ChipSelect => register << SPI_REGISTER_SHIFT,
        };
        let [high, low] = value.to_be_bytes();
        self.bus.write(self.address, &[command, high, low]).await?;
        Ok(())
    }

    pub async fn write_u8(&mut self, register: u8, value: u8) -> Result<(), ReadError> {
        self.bus.write(self.address, &[register, value]).await?;
        Ok(())
    }

    /// Makes sure that these registers of a byte hold these values.
    ///
    /// # Errors
    /// [`ReadError::OtherPart`] if one does not.
    pub async fn expect<const N: usize>(&mut self, values: [(u8, u8); N]) -> Result<(), ReadError> {
        for (register, value) in values {
            if self.read(register).await? != [value] {
                return Err(ReadError::OtherPart);
            }
        }
        Ok(())
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
