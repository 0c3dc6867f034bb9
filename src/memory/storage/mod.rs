//! Power-fail-safe key-value log in flash, for parameters, the signing key, and what is learnt of the packs.
//!
//! The region is a ring of sectors, of one or two blocks: units of erase. The active one, with the highest sequence number, holds every stored value:
//!
//! | bytes of a sector | content |
//! |---|---|
//! | first 12 | header: magic, sequence number, CRC-32 |
//! | 4 | retired mark: blank until the next sector is active |
//! | 12 each, of wider values up to 140 | records: key, value, CRC-32 |
//! | last 16 | copy of the header; 4 bytes of mark if the sector was erased ahead |
//!
//! A store appends a record. When the sector is full, the next one gets the latest record of every key, and
//! becomes active with its header, which is written last. So valid data is never erased or overwritten, and a power cut
//! leaves either the old state or the new one, whatever the interrupted erase or write leaves behind.
//!
//! # Erases
//! An erase stops the processor for long. [`prepare`](Records::prepare) erases the next sector ahead of need, so that a move costs
//! writes of pages only. A move to a sector that is not prepared erases it first, or fails where that is forbidden.
//!
//! # Damage
//! A record with a wrong CRC is skipped: its key has the previous value, or none.
//! - In the newest record this is not reported: an interrupted store looks the same. The
//!   [`condition`](Records::condition) reports it.
//! - Any other damage to a value, up to the loss of the sector, is [`StorageError::Corrupt`] from
//!   [`load`](Storage::load), after all readable values have been delivered.
//! - The next value, even an equal one, is written to a fresh sector with all readable ones, which ends the damage. So does
//!   [`clear`](Records::clear).
//!
//! # Cost
//! A value of one word takes 12 bytes: the board's blocks of 4096 bytes hold 338 records, and two of them 680. One of 25
//! words takes 108 bytes, and a block holds 37; one of 33 words takes 140, and a block holds 29. A load or a move to the next sector
//! compares every record with all later ones instead of keeping a table in RAM: reads are cheap.

use core::marker::PhantomData;
use core::ops::{Deref, DerefMut, Range};

use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

mod error;
mod record;
mod region;
mod value;

pub use error::{Erase, FlashFault, MayErase, StorageError};
use record::{MAX_WORDS, Slot, StoredRecord};
use region::{Layout, Region, Sector, Unused};
pub use value::Value;

#[cfg(test)]
mod tests;

/// Integrity of the stored values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Condition {
    /// Erased: nothing was ever stored.
    Blank,
    /// All values are readable.
    Intact,
    /// One record is damaged: an interrupted store, or flipped bits.
    OneRecordDamaged,
    /// Several records, the active sector or everything is damaged.
    Damaged,
}

/// Result of a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Stored {
    /// Written and verified.
    Written,
    /// Flash holds the same bits already; nothing was written.
    Unchanged,
}

/// Key-value store of values of one width in a region of flash.
///
/// Unknown keys are kept, for another firmware version.
///
/// Yields to other tasks between flash operations, and after 0.2 ms of reading. Dropping a future before it completes is like a power cut.
#[derive(Debug)]
pub struct Storage<F, V = u32> {
    records: Records<F>,
    values: PhantomData<V>,
}

/// A [`Storage`] without the type of its values: so its code is there once for all types.
#[derive(Debug)]
pub struct Records<F> {
    region: Region<F>,
    /// Words of a value, and of one that older firmware stored. These are widened by zeros when they move to the next sector.
    words: u8,
    older_words: Option<u8>,
    /// Cached by the last successful call. `None` during writes, so that the next call scans the flash after a failure.
    log: Option<Log>,
    condition: Condition,
    preparation: Preparation,
}

/// Whether the next sector has to be prepared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Preparation {
    /// It was not looked at since the last move, or this many of its blocks were erased since.
    Due { erased: u32 },
    /// It is erased, or can't be.
    Done,
}

/// Result of a call of [`Records::prepare`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prepared {
    /// Another block has to be erased, by another call.
    Partly,
    /// Nothing can be done now.
    AsFarAsPossible,
}

/// The active sector.
#[derive(Clone, Copy, Debug)]
struct Log {
    sector: Sector,
    sequence: u32,
    /// Words of a value.
    words: u8,
    /// Slots from here on are blank.
    used: u32,
    /// Undamaged: another record may be appended.
    is_intact: bool,
    /// Undamaged, or damaged as by an interrupted store.
    is_trusted: bool,
    condition: Condition,
}

/// State that an interrupted clear leaves.
#[derive(Clone, Copy, Debug)]
enum IfInterrupted {
    /// All values.
    KeepAll,
    /// Outdated values reported as damage, or none.
    LeaveDamage,
}

/// Content of the sector that becomes the active one.
#[derive(Clone, Copy)]
enum NextSector<'a> {
    /// Empty; there is none before it.
    First,
    /// `newest`, and the latest record of every other key in `old` but for the first `left_out` that are dispensable.
    Moved {
        old: &'a Log,
        newest: Option<&'a StoredRecord>,
        left_out: u32,
        is_dispensable: &'a dyn Fn(u32) -> bool,
    },
}

impl<'a> NextSector<'a> {
    fn old(self) -> Option<&'a Log> {
        match self {
            Self::First => None,
            Self::Moved { old, .. } => Some(old),
        }
    }
}

impl<F: NorFlash, V: Value> Storage<F, V> {
    /// Storage in the complete sectors of `range`, an address range of `flash`. With fewer than two sectors, every
    /// store is [`StorageError::Full`]. Does not access the flash.
    pub fn new(flash: F, range: Range<u32>) -> Self {
        Self::with_layout(flash, range, Layout::Single)
    }

    /// Storage in sectors of two blocks each, for twice the values.
    pub fn of_double_sectors(flash: F, range: Range<u32>) -> Self {
        Self::with_layout(flash, range, Layout::Double)
    }

    fn with_layout(flash: F, range: Range<u32>, layout: Layout) -> Self {
        const { assert!(V::WORDS <= MAX_WORDS) }
        Self {
            records: Records {
                region: Region::new(flash, range, layout),
                words: V::WORDS as u8,
                older_words: None,
                log: None,
                condition: Condition::Damaged,
                preparation: Preparation::Due { erased: 0 },
            },
            values: PhantomData,
        }
    }

    /// Reads values of fewer words, too, which older firmware stored: those that are missing are zero.
    pub fn widening(mut self, older_words: u8) -> Self {
        self.records.older_words = Some(older_words);
        self
    }

    /// Calls `found` with the latest value of every key of 16 bits, in the order in which these were stored.
    ///
    /// # Errors
    /// [`StorageError::Corrupt`]: some values may be outdated or missing. [`StorageError::Flash`]: a read failed.
    pub async fn load(&mut self, found: &mut dyn FnMut(u16, V)) -> Result<(), StorageError> {
        let mut found = |key, record: &StoredRecord| found(key, V::from_words(record.value()));
        self.records.load_records(&mut found).await
    }

    /// The latest readable value of `key`.
    ///
    /// # Errors
    /// [`StorageError::Flash`]: a read failed.
    pub async fn read(&mut self, key: u32) -> Result<Option<V>, StorageError> {
        let mut record = StoredRecord::new(key, &[]);
        let is_found = self.records.read_record(&mut record).await?;
        Ok(is_found.then(|| V::from_words(record.value())))
    }

    /// Stores `value` under `key`, and verifies it.
    ///
    /// # Errors
    /// The previous value is kept; after [`StorageError::Flash`] it may be the new one.
    pub fn store(
        &mut self,
        key: u16,
        value: V,
        may_erase: MayErase<'_>,
    ) -> impl Future<Output = Result<Stored, StorageError>> {
        self.store_replacing(key.into(), value, &|_| false, may_erase)
    }

    /// Stores the value of any key, where `is_dispensable` returns whether the value of a key may be lost if there is no room: the one that
    /// was stored first is.
    ///
    /// # Errors
    /// As of [`store`](Self::store).
    pub fn store_replacing(
        &mut self,
        key: u32,
        value: V,
        is_dispensable: &dyn Fn(u32) -> bool,
        may_erase: MayErase<'_>,
    ) -> impl Future<Output = Result<Stored, StorageError>> {
        let record = StoredRecord::new(key, value.words());
        self.records.store_record(record, is_dispensable, may_erase)
    }
}

impl<F, V> Deref for Storage<F, V> {
    type Target = Records<F>;

    fn deref(&self) -> &Records<F> {
        &self.records
    }
}

impl<F, V> DerefMut for Storage<F, V> {
    fn deref_mut(&mut self) -> &mut Records<F> {
        &mut self.records
    }
}

impl<F: NorFlash> Records<F> {
    /// Values that fit.
    pub fn slots(&self) -> u32 {
        Region::<F>::slots_in(self.region.layout, self.words)
    }

    /// Calls `found` with the latest record of every key of 16 bits: see [`Storage::load`].
    async fn load_records(&mut self, found: &mut dyn FnMut(u16, &StoredRecord)) -> Result<(), StorageError> {
        self.condition = Condition::Damaged;
        let Some(log) = self.find_log().await? else {
            return match self.region.unused().await? {
                Some(Unused::Erased) => {
                    self.condition = Condition::Blank;
                    Ok(())
                }
                Some(Unused::FirstWriteInterrupted) => Ok(()),
                None => Err(StorageError::Corrupt),
            };
        };
        let mut record = StoredRecord::erased();
        let mut next = 0;
        while let Some(slot) = self.next(&log, next, &mut record).await? {
            next = slot + 1;
            record.widen(self.words.into());
            // Another firmware version may have wider keys.
            if let Ok(key) = u16::try_from(record.key()) {
                found(key, &record);
            }
        }
        self.condition = log.condition;
        log.is_trusted.then_some(()).ok_or(StorageError::Corrupt)
    }

    /// Integrity found by the last [`load`](Storage::load). Unlike its result, this counts an interrupted store as damage.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Replaces `record` by the latest readable one of its key; returns whether there is one.
    async fn read_record(&mut self, record: &mut StoredRecord) -> Result<bool, StorageError> {
        let Some(Log {
            sector, used, words, ..
        }) = self.known_log().await?
        else {
            return Ok(false);
        };
        let is_found = self.region.read_last(sector, 0..used, words, record).await?;
        record.widen(self.words.into());
        Ok(is_found)
    }

    /// Whether there is nothing that [`prepare`](Self::prepare) could do.
    pub fn is_prepared(&self) -> bool {
        self.preparation == Preparation::Done
    }

    /// Erases a block of the sector that the next move needs, if that is not erased and it is allowed. Without a stored
    /// value there is none. To be called until nothing can be done.
    ///
    /// # Errors
    /// [`StorageError::Flash`]: the sector can't be erased. The next move will try again.
    pub async fn prepare(&mut self, may_erase: MayErase<'_>) -> Result<Prepared, StorageError> {
        let (Preparation::Due { erased }, Erase::Allowed) = (self.preparation, may_erase()) else {
            return Ok(Prepared::AsFarAsPossible);
        };
        let Some(log) = self.known_log().await?.filter(|_| self.region.can_move()) else {
            self.preparation = Preparation::Done;
            return Ok(Prepared::AsFarAsPossible);
        };
        let next = self.region.after(log.sector);
        match self.prepare_block(next, erased, may_erase).await {
            Ok(Prepared::Partly) => {
                self.preparation = Preparation::Due { erased: erased + 1 };
                Ok(Prepared::Partly)
            }
            // Forbidden in the meantime: another time.
            Err(StorageError::NoErasedSpace) => Ok(Prepared::AsFarAsPossible),
            done => {
                self.preparation = Preparation::Done;
                done
            }
        }
    }

    /// Erases the next block of `sector`, of which this many are `erased`.
    async fn prepare_block(
        &mut self,
        sector: Sector,
        erased: u32,
        may_erase: MayErase<'_>,
    ) -> Result<Prepared, StorageError> {
        if erased == 0 && self.region.is_erased_ahead(sector).await? {
            return Ok(Prepared::AsFarAsPossible);
        }
        self.region.erase_block(sector, erased, may_erase).await?;
        if erased + 1 < self.region.layout.blocks() {
            return Ok(Prepared::Partly);
        }
        self.region.mark_erased_ahead(sector).await?;
        Ok(Prepared::AsFarAsPossible)
    }

    /// Stores `record`, and verifies it: see [`Storage::store_replacing`].
    async fn store_record(
        &mut self,
        record: StoredRecord,
        is_dispensable: &dyn Fn(u32) -> bool,
        may_erase: MayErase<'_>,
    ) -> Result<Stored, StorageError> {
        let is_equal = {
            let mut latest = record;
            self.read_record(&mut latest).await? && latest.bytes() == record.bytes()
        };
        let mut log = match self.log.take() {
            Some(log) => log,
            None => self.start_sector(NextSector::First, may_erase).await?,
        };
        // Of a damaged sector even an equal value is written: to the next one.
        if log.is_trusted && is_equal {
            self.log = Some(log);
            return Ok(Stored::Unchanged);
        }
        if log.is_intact && log.used < self.slots() && log.words == self.words {
            self.region.write_record(log.sector, log.used, &record).await?;
            log.used += 1;
        } else {
            // Before the erase, so that repeated attempts to store another key do not wear the flash.
            let left_out = self.find_place(record.key(), &log, is_dispensable).await?;
            let next = NextSector::Moved {
                old: &log,
                newest: Some(&record),
                left_out,
                is_dispensable,
            };
            let started = self.start_sector(next, may_erase).await;
            if started.is_err_and(|error| error == StorageError::NoErasedSpace) {
                // Nothing has changed, and more attempts may follow.
                self.log = Some(log);
            }
            log = started?;
        }
        self.log = Some(log);
        Ok(Stored::Written)
    }

    /// Erases all values atomically: a power cut leaves all or none.
    ///
    /// # Errors
    /// [`StorageError::Flash`] leaves all or none, too. [`StorageError::NoErasedSpace`] leaves all.
    pub fn clear(&mut self, may_erase: MayErase<'_>) -> impl Future<Output = Result<(), StorageError>> {
        self.clear_with(IfInterrupted::KeepAll, None, may_erase)
    }

    /// Erases all values but that of `key`, atomically: a power cut leaves all, or this one.
    ///
    /// # Errors
    /// As of [`clear`](Self::clear).
    pub fn clear_but(
        &mut self,
        key: u16,
        may_erase: MayErase<'_>,
    ) -> impl Future<Output = Result<(), StorageError>> {
        self.clear_with(IfInterrupted::KeepAll, Some(key.into()), may_erase)
    }

    /// Erases all values. A power cut or failure leaves no value or [`Condition::Damaged`], unless no write takes
    /// effect at all.
    ///
    /// # Errors
    /// [`StorageError::Flash`]: a write failed. [`StorageError::NoErasedSpace`]: an erase was forbidden; if not from the
    /// beginning, this counts as an interruption.
    pub fn start_over(&mut self, may_erase: MayErase<'_>) -> impl Future<Output = Result<(), StorageError>> {
        self.clear_with(IfInterrupted::LeaveDamage, None, may_erase)
    }

    async fn clear_with(
        &mut self,
        if_interrupted: IfInterrupted,
        kept: Option<u32>,
        may_erase: MayErase<'_>,
    ) -> Result<(), StorageError> {
        self.log = None;
        let log = self.find_log().await?;
        let is_clear = match &log {
            Some(log) => log.is_intact && log.used == 0,
            None => self.region.unused().await?.is_some(),
        };
        if is_clear {
            return Ok(());
        }
        if let (Some(log), IfInterrupted::LeaveDamage) = (&log, if_interrupted) {
            let next = self.region.after(log.sector);
            if may_erase() == Erase::Forbidden && !self.region.is_erased_ahead(next).await? {
                return Err(StorageError::NoErasedSpace);
            }
            self.region.retire(log.sector).await?;
        }
        let is_dispensable = |key| Some(key) != kept;
        let next = log.as_ref().map_or(NextSector::First, |old| NextSector::Moved {
            old,
            newest: None,
            left_out: u32::MAX,
            is_dispensable: &is_dispensable,
        });
        self.log = Some(self.start_sector(next, may_erase).await?);
        Ok(())
    }

    /// Activates the next sector.
    async fn start_sector(
        &mut self,
        next: NextSector<'_>,
        may_erase: MayErase<'_>,
    ) -> Result<Log, StorageError> {
        if !self.region.can_move() {
            return Err(StorageError::Full);
        }
        // Its blocks may be written from here on.
        if let Preparation::Due { erased } = &mut self.preparation {
            *erased = 0;
        }
        // After an interrupted erase a sector may read as blank without retaining data, so to be blank is not enough. A
        // region that was never used needs no erase.
        let (sector, sequence, is_erased) = match next.old() {
            Some(old) => {
                let sequence = old.sequence.checked_add(1).ok_or(StorageError::Corrupt)?;
                let after = self.region.after(old.sector);
                (after, sequence, self.region.is_erased_ahead(after).await?)
            }
            None => {
                let blank = self.region.find_blank_sector().await?;
                (blank.unwrap_or_default(), 1, blank.is_some())
            }
        };
        if !is_erased {
            self.region.erase(sector, may_erase).await?;
        }
        self.preparation = Preparation::Due { erased: 0 };
        let mut used = 0;
        if let NextSector::Moved {
            old,
            newest,
            mut left_out,
            is_dispensable,
        } = next
        {
            let mut record = StoredRecord::erased();
            let mut from = 0;
            while let Some(slot) = self.next(old, from, &mut record).await? {
                from = slot + 1;
                if newest.is_some_and(|newest| record.key() == newest.key()) {
                    continue;
                }
                if left_out > 0 && is_dispensable(record.key()) {
                    left_out -= 1;
                    continue;
                }
                record.widen(self.words.into());
                self.region.write_record(sector, used, &record).await?;
                used += 1;
            }
            if let Some(newest) = newest {
                self.region.write_record(sector, used, newest).await?;
                used += 1;
            }
        }
        // Commit: a power cut before this leaves the old sector active, one after it the new sector.
        self.region.write_sequence(sector, sequence, self.words).await?;
        if let Some(old) = next.old() {
            // Marks the old sector as outdated, in case the new one is lost.
            self.region.retire(old.sector).await?;
        }
        Ok(Log {
            sector,
            sequence,
            words: self.words,
            used,
            is_intact: true,
            is_trusted: true,
            condition: Condition::Intact,
        })
    }

    /// Number of dispensable records that make room for `key` when `log` moves to the next sector.
    async fn find_place(
        &mut self,
        key: u32,
        log: &Log,
        is_dispensable: &dyn Fn(u32) -> bool,
    ) -> Result<u32, StorageError> {
        let slots = self.slots();
        if log.used < slots {
            return Ok(0);
        }
        let (mut others, mut dispensable) = (0_u32, 0);
        let mut record = StoredRecord::erased();
        let mut next = 0;
        while let Some(slot) = self.next(log, next, &mut record).await? {
            next = slot + 1;
            if record.key() != key {
                others += 1;
                dispensable += u32::from(is_dispensable(record.key()));
            }
        }
        let left_out = (others + 1).saturating_sub(slots);
        (left_out <= dispensable)
            .then_some(left_out)
            .ok_or(StorageError::Full)
    }

    /// The active sector, which is scanned for if it is not known.
    async fn known_log(&mut self) -> Result<Option<Log>, StorageError> {
        if self.log.is_none() {
            self.log = self.find_log().await?;
        }
        Ok(self.log)
    }

    /// Scans for the active sector: that with the highest sequence number.
    async fn find_log(&mut self) -> Result<Option<Log>, StorageError> {
        let mut newest: Option<(Sector, u32, u8)> = None;
        for words in [Some(self.words), self.older_words].into_iter().flatten() {
            for sector in self.region.sectors() {
                if let Some(sequence) = self.region.read_sequence(sector, words).await?
                    && newest.is_none_or(|(_, highest, _)| sequence > highest)
                {
                    newest = Some((sector, sequence, words));
                }
            }
        }
        let Some((sector, sequence, words)) = newest else {
            return Ok(None);
        };
        self.scan(sector, sequence, words).await.map(Some)
    }

    /// Looks through the slots of the active sector.
    async fn scan(&mut self, sector: Sector, sequence: u32, words: u8) -> Result<Log, StorageError> {
        let mut used = 0;
        let mut records = 0;
        let mut record = StoredRecord::erased();
        let mut ends_damaged = false;
        // Damaged slots, as far as they can be recognised.
        let mut damaged = 0;
        for slot in 0..Region::<F>::slots_in(self.region.layout, words) {
            if slot.is_multiple_of(Region::<F>::slots_of_a_read(words)) {
                yield_now().await;
            }
            match self.region.read_slot(sector, slot, words, &mut record).await? {
                Slot::Blank => continue,
                Slot::Record => {
                    // Blank slots before a record are damaged ones.
                    damaged = slot - records;
                    records += 1;
                    ends_damaged = false;
                }
                Slot::Damaged => {
                    damaged += 1;
                    ends_damaged = true;
                }
            }
            used = slot + 1;
        }
        let is_retired = self.region.is_retired(sector).await?;
        let is_intact = records == used && !is_retired;
        let is_interrupted_store = records + 1 == used && ends_damaged && !is_retired;
        Ok(Log {
            sector,
            sequence,
            words,
            used,
            is_intact,
            is_trusted: is_intact || is_interrupted_store,
            condition: match damaged {
                _ if is_retired => Condition::Damaged,
                0 => Condition::Intact,
                1 => Condition::OneRecordDamaged,
                _ => Condition::Damaged,
            },
        })
    }

    /// Reads the next record into `record`, from `slot` on, that is not superseded by a later one; returns its slot.
    async fn next(
        &mut self,
        log: &Log,
        slot: u32,
        record: &mut StoredRecord,
    ) -> Result<Option<u32>, StorageError> {
        let Log {
            sector, used, words, ..
        } = *log;
        for slot in slot..used {
            yield_now().await;
            let content = self.region.read_slot(sector, slot, words, record).await?;
            let later = slot + 1..used;
            if content == Slot::Record && !self.region.read_last(sector, later, words, record).await? {
                return Ok(Some(slot));
            }
        }
        Ok(None)
    }
}
