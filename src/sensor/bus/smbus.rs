//! Commands of a smart battery: words and blocks, the lowest byte first, with a packet error code if it has them.

use super::{Address, SensorBus};
use crate::battery::{BusError, Name, ReadError};

/// Whether a device sends a packet error code behind its data (SMBus 1.1 and later).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub(super) enum PacketErrorCode {
    Absent,
    Sent,
}

/// The longest block (SMBus 2.0, 5.5.7).
const BLOCK_BYTES: usize = 32;

/// Length, data and packet error code.
const LONGEST_ANSWER: usize = 1 + BLOCK_BYTES + 1;

/// Both addresses and the command, over which the packet error code goes, too.
const HEADER_BYTES: usize = 3;

/// The device at an address.
pub(super) struct SmBus<'a, B> {
    bus: &'a mut B,
    address: Address,
    code: PacketErrorCode,
}

impl<'a, B: SensorBus> SmBus<'a, B> {
    pub fn new(bus: &'a mut B, address: Address, code: PacketErrorCode) -> Self {
        Self { bus, address, code }
    }

    /// Read Word; `None` if the device refuses it. If the device has gone altogether, the command that it can't refuse shows that.
    pub async fn word(&mut self, command: u8) -> Result<Option<u16>, ReadError> {
        let mut bytes = [0; 2];
        match self.read(command, &mut bytes).await {
            Ok(()) => Ok(Some(u16::from_le_bytes(bytes))),
            Err(ReadError::Bus(BusError::NoAnswer)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Read Block of `N` bytes, with their packet error code if there is one.
    pub async fn block<const N: usize>(&mut self, command: u8) -> Result<[u8; N], ReadError> {
        let mut answer = [0; 1 + BLOCK_BYTES];
        let answer = answer.get_mut(..=N).ok_or(ReadError::Implausible)?;
        self.read(command, answer).await?;
        match answer.split_first() {
            Some((length, block)) if usize::from(*length) == N => {
                block.try_into().map_err(|_| ReadError::Implausible)
            }
            _ => Err(ReadError::Implausible),
        }
    }

    /// `N` bytes as they are: without a length, and without a packet error code.
    pub async fn bare<const N: usize>(&mut self, command: u8) -> Result<[u8; N], ReadError> {
        let mut answer = [0; N];
        self.transfer(command, &mut answer).await?;
        Ok(answer)
    }

    /// Read Block, as a name. It is empty if the device refuses it, if it is longer than a block can be, or if it fails its
    /// checksum: nothing depends on a name.
    pub async fn name(&mut self, command: u8) -> Result<Name, ReadError> {
        let mut block = [0; 1 + BLOCK_BYTES];
        match self.read_block(command, &mut block).await {
            Ok(bytes) => Ok(Name::from_ascii(block.get(1..=bytes).unwrap_or(&[]))),
            Err(ReadError::Implausible | ReadError::Bus(BusError::NoAnswer | BusError::Checksum)) => {
                Ok(Name::EMPTY)
            }
            Err(error) => Err(error),
        }
    }

    /// Returns the length of the block, which is its first byte and so is read twice.
    async fn read_block(
        &mut self,
        command: u8,
        block: &mut [u8; 1 + BLOCK_BYTES],
    ) -> Result<usize, ReadError> {
        let mut length = 0;
        self.transfer(command, core::slice::from_mut(&mut length)).await?;
        let bytes = usize::from(length);
        let block = block.get_mut(..=bytes).ok_or(ReadError::Implausible)?;
        self.read(command, block).await?;
        Ok(bytes)
    }

    /// Reads `data`, and the packet error code behind it if there is one.
    async fn read(&mut self, command: u8, data: &mut [u8]) -> Result<(), ReadError> {
        if self.code == PacketErrorCode::Absent {
            return self.transfer(command, data).await;
        }
        let mut buffer = [0; LONGEST_ANSWER];
        let answer = buffer.get_mut(..=data.len()).ok_or(ReadError::Implausible)?;
        self.transfer(command, answer).await?;
        let (code, received) = answer.split_last().ok_or(ReadError::Implausible)?;
        if packet_error_code(self.address, command, received) != *code {
            return Err(BusError::Checksum.into());
        }
        for (place, byte) in data.iter_mut().zip(received) {
            *place = *byte;
        }
        Ok(())
    }

    async fn transfer(&mut self, command: u8, answer: &mut [u8]) -> Result<(), ReadError> {
        self.bus.write_read(self.address, &[command], answer).await?;
        Ok(())
    }
}

/// CRC-8 over everything on the wire, the addresses included.
fn packet_error_code(address: Address, command: u8, data: &[u8]) -> u8 {
    let Address::I2c(bits) = address else {
        return 0;
    };
    let write = bits << 1;
    let header: [u8; HEADER_BYTES] = [write, command, write | 1];
    let mut message = heapless::Vec::<u8, { HEADER_BYTES + LONGEST_ANSWER }>::new();
    // Both fit: no answer is longer.
    let _ = message.extend_from_slice(&header);
    let _ = message.extend_from_slice(data);
    smbus_pec::pec(&message)
}
