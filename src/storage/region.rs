//! A region of flash as sectors with two headers and slots for records; see [`super`] for the layout.

use core::marker::PhantomData;
use core::ops::Range;

use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

use super::record::{Header, Record, Slot};
use super::value::Value;
use super::{Erase, FlashFault, MayErase, StorageError};

/// The complete sectors of a region.
#[derive(Debug)]
pub(super) struct Region<F, V> {
    pub flash: F,
    pub sectors: u32,
    start: u32,
    values: PhantomData<V>,
}

/// Why a region holds no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unused {
    /// Erased.
    Erased,
    /// The very first write was interrupted.
    FirstWriteInterrupted,
}

impl Unused {
    /// Offset from which every sector is blank.
    fn blank_from(self) -> u32 {
        match self {
            Self::Erased => 0,
            Self::FirstWriteInterrupted => MARGIN,
        }
    }
}

const WORD: usize = size_of::<u32>();
/// Bytes at either end of a sector for headers.
const MARGIN: u32 = 16;
/// Offset of the retired mark: a word that is blank until the next sector is active.
const RETIRED: u32 = Header::SIZE as u32;
/// The last word of a sector that was erased ahead of its use, written once the erase was complete.
const ERASED_AHEAD: [u8; WORD] = *b"ERSD";
/// The end of such a sector.
const END_ERASED_AHEAD: [u8; MARGIN as usize] = {
    let mut end = [0xFF; MARGIN as usize];
    let (_, mark) = end.split_at_mut(MARGIN as usize - WORD);
    mark.copy_from_slice(&ERASED_AHEAD);
    end
};

impl<F: NorFlash, V: Value> Region<F, V> {
    const SECTOR: u32 = F::ERASE_SIZE as u32;
    /// Record slots of a sector.
    pub const SLOTS: u32 = (Self::SECTOR - 2 * MARGIN) / Record::<V>::SIZE as u32;

    pub fn new(flash: F, range: Range<u32>) -> Self {
        const {
            assert!(WORD.is_multiple_of(F::READ_SIZE) && WORD.is_multiple_of(F::WRITE_SIZE));
            assert!(F::ERASE_SIZE.is_multiple_of(MARGIN as usize) && F::ERASE_SIZE >= 64);
        }
        let first = range.start.div_ceil(Self::SECTOR);
        let sectors = (range.end / Self::SECTOR).saturating_sub(first);
        Self {
            flash,
            sectors,
            start: first.saturating_mul(Self::SECTOR),
            values: PhantomData,
        }
    }

    /// Sequence number of a committed sector, from either of its headers.
    pub async fn read_sequence(&mut self, sector: u32) -> Result<Option<u32>, StorageError> {
        for address in self.header_addresses(sector) {
            if let Some(header) = Header::from_bytes(&self.read(address).await?, V::MAGIC) {
                return Ok(Some(header.sequence));
            }
        }
        Ok(None)
    }

    /// Commits a sector.
    pub async fn write_sequence(&mut self, sector: u32, sequence: u32) -> Result<(), StorageError> {
        for address in self.header_addresses(sector) {
            self.write(address, &Header { sequence }.to_bytes(V::MAGIC))
                .await?;
        }
        Ok(())
    }

    /// Whether a sector with a higher sequence number has been committed.
    pub async fn is_retired(&mut self, sector: u32) -> Result<bool, StorageError> {
        Ok(self.read(self.address(sector) + RETIRED).await? != [0xFF; WORD])
    }

    pub async fn retire(&mut self, sector: u32) -> Result<(), StorageError> {
        if self.is_retired(sector).await? {
            return Ok(());
        }
        self.write(self.address(sector) + RETIRED, &[0; WORD]).await
    }

    pub async fn read_slot(&mut self, sector: u32, slot: u32) -> Result<Slot<V>, StorageError> {
        Ok(Slot::from_bytes(&self.read_record(sector, slot).await?))
    }

    /// The value in `slot`, if its key is `key`.
    pub async fn read_value(&mut self, sector: u32, slot: u32, key: u32) -> Result<Option<V>, StorageError> {
        let bytes = self.read_record(sector, slot).await?;
        // Comparing the key first is cheaper than the CRC.
        if !Record::<V>::may_have_key(&bytes, key) {
            return Ok(None);
        }
        Ok(match Slot::from_bytes(&bytes) {
            Slot::Record(record) => Some(record.value),
            Slot::Blank | Slot::Damaged => None,
        })
    }

    async fn read_record(&mut self, sector: u32, slot: u32) -> Result<V::Record, StorageError> {
        let mut bytes = V::ERASED;
        self.read_into(self.slot_address(sector, slot), bytes.as_mut())
            .await?;
        Ok(bytes)
    }

    pub async fn write_record(
        &mut self,
        sector: u32,
        slot: u32,
        record: Record<V>,
    ) -> Result<(), StorageError> {
        if slot >= Self::SLOTS {
            return Err(StorageError::Full);
        }
        let bytes = record.to_bytes();
        self.program(self.slot_address(sector, slot), bytes.as_ref())
            .await?;
        verified(self.read_record(sector, slot).await? == bytes)
    }

    /// Whether the region was never used; `None` if a value may have been stored.
    pub async fn unused(&mut self) -> Result<Option<Unused>, StorageError> {
        let mut unused = Unused::Erased;
        for sector in 0..self.sectors {
            while !self.is_blank_from(unused.blank_from(), sector).await? {
                if unused == Unused::FirstWriteInterrupted {
                    return Ok(None);
                }
                unused = Unused::FirstWriteInterrupted;
            }
        }
        Ok(Some(unused))
    }

    pub async fn find_blank_sector(&mut self) -> Result<Option<u32>, StorageError> {
        for sector in 0..self.sectors {
            if self.is_blank(sector).await? {
                return Ok(Some(sector));
            }
        }
        Ok(None)
    }

    pub async fn is_blank(&mut self, sector: u32) -> Result<bool, StorageError> {
        self.is_blank_from(0, sector).await
    }

    async fn is_blank_from(&mut self, start: u32, sector: u32) -> Result<bool, StorageError> {
        self.is_blank_in(start..Self::SECTOR, sector).await
    }

    async fn is_blank_in(&mut self, offsets: Range<u32>, sector: u32) -> Result<bool, StorageError> {
        for offset in offsets.step_by(MARGIN as usize) {
            if self.read(self.address(sector) + offset).await? != [0xFF; MARGIN as usize] {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether the sector was erased ahead, and nothing was written to it since. Its mark distinguishes it from a sector
    /// whose erase was interrupted, which may read as blank without retaining data.
    pub async fn is_erased_ahead(&mut self, sector: u32) -> Result<bool, StorageError> {
        let end = Self::SECTOR - MARGIN;
        Ok(self.read(self.address(sector) + end).await? == END_ERASED_AHEAD
            && self.is_blank_in(0..end, sector).await?)
    }

    /// Erases a sector ahead of its use.
    pub async fn erase_ahead(&mut self, sector: u32, may_erase: MayErase<'_>) -> Result<(), StorageError> {
        self.erase(sector, may_erase).await?;
        let mark = self.address(sector) + Self::SECTOR - WORD as u32;
        self.write(mark, &ERASED_AHEAD).await
    }

    pub async fn erase(&mut self, sector: u32, may_erase: MayErase<'_>) -> Result<(), StorageError> {
        // An erase blocks the processor, so other ready tasks run first. The same for `program`.
        yield_now().await;
        // After they ran: they may have armed the vehicle.
        if may_erase() == Erase::Forbidden {
            return Err(StorageError::NoErasedSpace);
        }
        let address = self.address(sector);
        self.flash
            .erase(address, address + Self::SECTOR)
            .await
            .map_err(StorageError::of_driver)?;
        verified(self.is_blank(sector).await?)
    }

    async fn write<const N: usize>(&mut self, address: u32, bytes: &[u8; N]) -> Result<(), StorageError> {
        self.program(address, bytes).await?;
        verified(self.read(address).await? == *bytes)
    }

    async fn program(&mut self, address: u32, bytes: &[u8]) -> Result<(), StorageError> {
        yield_now().await;
        self.flash
            .write(address, bytes)
            .await
            .map_err(StorageError::of_driver)
    }

    async fn read<const N: usize>(&mut self, address: u32) -> Result<[u8; N], StorageError> {
        let mut bytes = [0; N];
        self.read_into(address, &mut bytes).await?;
        Ok(bytes)
    }

    async fn read_into(&mut self, address: u32, bytes: &mut [u8]) -> Result<(), StorageError> {
        self.flash
            .read(address, bytes)
            .await
            .map_err(StorageError::of_driver)
    }

    /// The sector after this one in the ring.
    pub fn after(&self, sector: u32) -> u32 {
        let next = sector + 1;
        if next < self.sectors { next } else { 0 }
    }

    fn address(&self, sector: u32) -> u32 {
        self.start + sector * Self::SECTOR
    }

    fn header_addresses(&self, sector: u32) -> [u32; 2] {
        let front = self.address(sector);
        [front, front + Self::SECTOR - MARGIN]
    }

    fn slot_address(&self, sector: u32, slot: u32) -> u32 {
        self.address(sector) + MARGIN + slot * Record::<V>::SIZE as u32
    }
}

/// The result of a flash operation, by what was read back.
fn verified(is_as_written: bool) -> Result<(), StorageError> {
    if is_as_written {
        Ok(())
    } else {
        Err(StorageError::Flash(FlashFault::NotVerified))
    }
}
