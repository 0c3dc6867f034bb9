//! A region of flash as sectors with two headers and slots for records; see [`super`] for their content.

use core::ops::Range;

use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

use super::record::{Slot, StoredRecord};
use super::{Erase, FlashFault, MayErase, StorageError};

/// A sector of a region, counted from its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sector(pub u32);

/// The complete blocks of a region.
#[derive(Debug)]
pub(super) struct Region<F> {
    pub flash: F,
    pub layout: Layout,
    start: u32,
    blocks: u32,
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
    /// Offset from which every block is blank.
    fn blank_from(self) -> u32 {
        match self {
            Self::Erased => 0,
            Self::FirstWriteInterrupted => MARGIN,
        }
    }
}

const WORD: usize = size_of::<u32>();
/// Bytes that are read at once in a search: whole records of each width.
const READ_BYTES: usize = 192;
/// Bytes that are looked through for content in one turn.
const BLANK_BYTES_A_TURN: u32 = 256;
/// Bytes at either end of a sector for headers.
const MARGIN: u32 = 16;
/// Offset of the retired mark: a word that is blank until the next sector is active.
const RETIRED: u32 = StoredRecord::size(1) as u32;
/// The last word of a sector that was erased ahead of its use, written once the erase was complete.
const ERASED_AHEAD: [u8; WORD] = *b"ERSD";
/// The end of such a sector.
const END_ERASED_AHEAD: [u8; MARGIN as usize] = {
    let mut end = [0xFF; MARGIN as usize];
    let (_, mark) = end.split_at_mut(MARGIN as usize - WORD);
    mark.copy_from_slice(&ERASED_AHEAD);
    end
};

impl<F: NorFlash> Region<F> {
    const BLOCK: u32 = F::ERASE_SIZE as u32;

    pub fn new(flash: F, range: Range<u32>, layout: Layout) -> Self {
        const {
            assert!(WORD.is_multiple_of(F::READ_SIZE) && WORD.is_multiple_of(F::WRITE_SIZE));
            assert!(F::ERASE_SIZE.is_multiple_of(MARGIN as usize) && F::ERASE_SIZE >= 64);
        }
        let first = range.start.div_ceil(Self::BLOCK);
        Self {
            flash,
            layout,
            start: first.saturating_mul(Self::BLOCK),
            blocks: (range.end / Self::BLOCK).saturating_sub(first),
        }
    }

    /// Slots of a sector for values of so many words.
    pub const fn slots_in(layout: Layout, words: u8) -> u32 {
        (layout.blocks() * Self::BLOCK - 2 * MARGIN) / StoredRecord::size(words as usize) as u32
    }

    /// Slots for values of so many words that are read at once, or in one turn.
    pub const fn slots_of_a_read(words: u8) -> u32 {
        (READ_BYTES / StoredRecord::size(words as usize)) as u32
    }

    /// Whether there is a sector for a move.
    pub fn can_move(&self) -> bool {
        self.count() >= 2
    }

    /// Its sectors.
    pub fn sectors(&self) -> impl Iterator<Item = Sector> + use<F> {
        (0..self.count()).map(Sector)
    }

    fn count(&self) -> u32 {
        self.blocks / self.layout.blocks()
    }

    /// Sequence number of a committed sector with values of so many words, from either of its headers.
    pub async fn read_sequence(&mut self, sector: Sector, words: u8) -> Result<Option<u32>, StorageError> {
        for address in self.header_addresses(sector) {
            let mut header = StoredRecord::erased();
            self.read(address, header.bytes_mut(StoredRecord::size(1)))
                .await?;
            if let Some(sequence) = header.sequence(self.layout.magic(words)) {
                return Ok(Some(sequence));
            }
        }
        Ok(None)
    }

    /// Commits a sector with values of so many words.
    pub async fn write_sequence(
        &mut self,
        sector: Sector,
        sequence: u32,
        words: u8,
    ) -> Result<(), StorageError> {
        let header = StoredRecord::new(self.layout.magic(words), &[sequence]);
        for address in self.header_addresses(sector) {
            self.write(address, header.bytes()).await?;
        }
        Ok(())
    }

    /// Whether a sector with a higher sequence number has been committed.
    pub async fn is_retired(&mut self, sector: Sector) -> Result<bool, StorageError> {
        Ok(!self.holds(self.retired_address(sector), &[0xFF; WORD]).await?)
    }

    pub async fn retire(&mut self, sector: Sector) -> Result<(), StorageError> {
        if self.is_retired(sector).await? {
            return Ok(());
        }
        self.write(self.retired_address(sector), &[0; WORD]).await
    }

    /// Reads what is in a slot for a value of so many words into `record`.
    pub async fn read_slot(
        &mut self,
        sector: Sector,
        slot: u32,
        words: u8,
        record: &mut StoredRecord,
    ) -> Result<Slot, StorageError> {
        let bytes = record.bytes_mut(StoredRecord::size(words.into()));
        let address = self.slot_address(sector, slot, bytes.len());
        self.read(address, bytes).await?;
        Ok(Slot::of(bytes))
    }

    /// Replaces `record` by the one of its key in the last of these slots, for values of so many words, that has one; returns
    /// whether one has.
    pub async fn read_last(
        &mut self,
        sector: Sector,
        slots: Range<u32>,
        words: u8,
        record: &mut StoredRecord,
    ) -> Result<bool, StorageError> {
        let key = record.key().to_le_bytes();
        let mut buffer = [0; READ_BYTES];
        let mut end = slots.end;
        while end > slots.start {
            let first = end.saturating_sub(Self::slots_of_a_read(words)).max(slots.start);
            let size = StoredRecord::size(words.into());
            let bytes = (end - first) as usize * size;
            let records = buffer.get_mut(..bytes).unwrap_or_default();
            self.read(self.slot_address(sector, first, size), records).await?;
            // Computed again: if kept over the read, the compiler could not see that it is above zero, and `rchunks` could panic.
            let mut records = records.rchunks(StoredRecord::size(words.into()));
            // Comparing the key first is cheaper than the CRC.
            if records.any(|bytes| bytes.starts_with(&key) && record.replace(bytes)) {
                return Ok(true);
            }
            end = first;
        }
        Ok(false)
    }

    /// Writes `record` to a slot of its own width.
    pub async fn write_record(
        &mut self,
        sector: Sector,
        slot: u32,
        record: &StoredRecord,
    ) -> Result<(), StorageError> {
        let bytes = record.bytes();
        let address = self.slot_address(sector, slot, bytes.len());
        if address + bytes.len() as u32 > self.addresses(sector).end - MARGIN {
            return Err(StorageError::Full);
        }
        self.write(address, bytes).await
    }

    /// Whether the region was never used; `None` if a value may have been stored.
    pub async fn unused(&mut self) -> Result<Option<Unused>, StorageError> {
        let mut unused = Unused::Erased;
        for block in 0..self.blocks {
            while !self.is_block_blank_from(unused.blank_from(), block).await? {
                if unused == Unused::FirstWriteInterrupted {
                    return Ok(None);
                }
                unused = Unused::FirstWriteInterrupted;
            }
        }
        Ok(Some(unused))
    }

    pub async fn find_blank_sector(&mut self) -> Result<Option<Sector>, StorageError> {
        for sector in self.sectors() {
            if self.is_blank_in(self.addresses(sector)).await? {
                return Ok(Some(sector));
            }
        }
        Ok(None)
    }

    fn is_block_blank_from(
        &mut self,
        start: u32,
        block: u32,
    ) -> impl Future<Output = Result<bool, StorageError>> {
        let address = self.block_address(block);
        self.is_blank_in(address + start..address + Self::BLOCK)
    }

    async fn is_blank_in(&mut self, addresses: Range<u32>) -> Result<bool, StorageError> {
        for address in addresses.step_by(MARGIN as usize) {
            if address.is_multiple_of(BLANK_BYTES_A_TURN) {
                yield_now().await;
            }
            if !self.holds(address, &[0xFF; MARGIN as usize]).await? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether the sector was erased ahead, and nothing was written to it since. Its mark distinguishes it from a sector
    /// whose erase was interrupted, which may read as blank without retaining data.
    pub async fn is_erased_ahead(&mut self, sector: Sector) -> Result<bool, StorageError> {
        let [start, end] = self.header_addresses(sector);
        Ok(self.holds(end, &END_ERASED_AHEAD).await? && self.is_blank_in(start..end).await?)
    }

    /// Marks a sector that was erased ahead of its use.
    pub fn mark_erased_ahead(&mut self, sector: Sector) -> impl Future<Output = Result<(), StorageError>> {
        let mark = self.addresses(sector).end - WORD as u32;
        self.write(mark, &ERASED_AHEAD)
    }

    pub async fn erase(&mut self, sector: Sector, may_erase: MayErase<'_>) -> Result<(), StorageError> {
        for block in 0..self.layout.blocks() {
            self.erase_block(sector, block, may_erase).await?;
        }
        Ok(())
    }

    /// Erases a block of a sector.
    pub async fn erase_block(
        &mut self,
        sector: Sector,
        block: u32,
        may_erase: MayErase<'_>,
    ) -> Result<(), StorageError> {
        // An erase blocks the processor, so other ready tasks run first. The same for `write`.
        yield_now().await;
        // After they ran: they may have armed the vehicle.
        if may_erase() == Erase::Forbidden {
            return Err(StorageError::NoErasedSpace);
        }
        let address = self.addresses(sector).start + block * Self::BLOCK;
        let erased = self.flash.erase(address, address + Self::BLOCK).await;
        erased.map_err(StorageError::of_driver)?;
        verified(self.is_blank_in(address..address + Self::BLOCK).await?)
    }

    async fn write(&mut self, address: u32, bytes: &[u8]) -> Result<(), StorageError> {
        yield_now().await;
        let written = self.flash.write(address, bytes).await;
        written.map_err(StorageError::of_driver)?;
        verified(self.holds(address, bytes).await?)
    }

    /// Whether these bytes, of a record at most, are read from `address` on.
    async fn holds(&mut self, address: u32, bytes: &[u8]) -> Result<bool, StorageError> {
        let mut record = StoredRecord::erased();
        let found = record.bytes_mut(bytes.len());
        self.read(address, found).await?;
        Ok(found == bytes)
    }

    async fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<(), StorageError> {
        let read = self.flash.read(address, bytes).await;
        read.map_err(StorageError::of_driver)
    }

    /// The sector after this one in the ring.
    pub fn after(&self, sector: Sector) -> Sector {
        let next = sector.0 + 1;
        Sector(if next < self.count() { next } else { 0 })
    }

    fn addresses(&self, sector: Sector) -> Range<u32> {
        let address = self.block_address(sector.0 * self.layout.blocks());
        address..address + self.layout.blocks() * Self::BLOCK
    }

    fn block_address(&self, block: u32) -> u32 {
        self.start + block * Self::BLOCK
    }

    fn header_addresses(&self, sector: Sector) -> [u32; 2] {
        let Range { start, end } = self.addresses(sector);
        [start, end - MARGIN]
    }

    fn retired_address(&self, sector: Sector) -> u32 {
        self.addresses(sector).start + RETIRED
    }

    fn slot_address(&self, sector: Sector, slot: u32, size: usize) -> u32 {
        self.addresses(sector).start + MARGIN + slot * size as u32
    }
}

/// The result of a flash operation, by what was read back.
fn verified(is_as_written: bool) -> Result<(), StorageError> {
    let result = is_as_written.then_some(());
    result.ok_or(StorageError::Flash(FlashFault::NotVerified))
}

/// Size of the sectors of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// A sector is one block, the flash's unit of erase.
    Single,
    /// A sector is two blocks.
    Double,
}

impl Layout {
    /// Blocks of a sector.
    pub const fn blocks(self) -> u32 {
        match self {
            Self::Single => 1,
            Self::Double => 2,
        }
    }

    /// Identifies the layout, and the width of the values, in the headers: what another firmware has stored with another
    /// one is not read.
    pub const fn magic(self, words: u8) -> u32 {
        let layout = match self {
            Self::Single => b'R',
            Self::Double => b'D',
        };
        u32::from_le_bytes([b'P', b'A', layout, b'0' + words])
    }
}
