//! Words stored under keys: a log in flash that survives a power cut at any moment.
//!
//! The parameters are kept in one, what message signing has to remember in another.
//!
//! The region is a ring of sectors. The one with the highest sequence number holds every stored value:
//!
//! | bytes of a sector | content |
//! |---|---|
//! | first 12 | header: magic, sequence number, CRC-32 |
//! | 4 | blank until the next sector has taken over |
//! | 12 each | records: key, value, CRC-32 |
//! | last 16 | the header once more, 4 bytes unused |
//!
//! A store appends one record. When the sector is full, the next one is erased, gets the newest record of every key, and
//! takes over with its header, which is written last. So nothing that counts is ever erased or overwritten, and a power
//! cut leaves either the old state or the new one, whatever the erase or the write that it interrupts leaves behind.
//!
//! # Damage
//! A record whose CRC is wrong is passed over: its key has the value stored before, or none.
//! - If that is the newest record, nothing is reported: a store that was cut short looks the same.
//! - Any other damage that concerns a value, up to the loss of the sector, is [`StorageError::Corrupt`] from
//!   [`load`](Storage::load), after all that can be read has been delivered.
//! - The next value that is written goes to a fresh sector, together with what was readable. That ends the damage.
//!   So does [`clear`](Storage::clear), with nothing stored.
//!
//! # Cost
//! With the board's sectors of 4096 bytes, a value takes 12 bytes and a sector holds 338 records. A load or a move to the
//! next sector compares every record with all later ones (reading is cheap there) instead of keeping a table in RAM.

use core::ops::Range;

use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

use record::{Record, Slot};
use region::{Region, Unused};

mod record;
mod region;

#[cfg(test)]
mod model;
#[cfg(test)]
mod tests;

/// Why the storage could not do what it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum StorageError {
    /// The flash reported an error, or does not hold what was just written to it.
    Flash,
    /// What is stored was damaged by something other than a power cut, or is not ours.
    Corrupt,
    /// There is no room for another key. What is stored stays.
    Full,
}

/// How much of what was stored can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Condition {
    /// Every byte is erased: nothing was ever stored.
    Blank,
    /// Everything.
    Whole,
    /// Everything but one record: a store that was cut short, or bits that changed.
    OneRecordDamaged,
    /// More is lost: records, the newest sector, or everything.
    Damaged,
}

/// What a store did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Stored {
    /// The value is in flash now.
    Written,
    /// It was there already, bit for bit; nothing was written.
    Unchanged,
}

/// Values of 32 bits in a region of flash, each under a key that never changes its meaning.
///
/// A key nobody asks for any more stays, so another firmware finds its values again.
///
/// Between two flash operations other tasks get a turn. A future that is dropped half way is like a power cut.
#[derive(Debug)]
pub struct Storage<F> {
    region: Region<F>,
    /// Known since the last call that went well. `None` while flash is being written, so that whatever happened, the next
    /// call looks for itself.
    log: Option<Log>,
    condition: Condition,
}

/// The sector that holds the stored values.
#[derive(Clone, Copy, Debug)]
struct Log {
    sector: u32,
    sequence: u32,
    /// Every slot from here on is blank.
    used: u32,
    /// Nothing is wrong with it: another record may follow.
    is_whole: bool,
    /// What is wrong with it, if anything, can be a store that was cut short.
    is_trusted: bool,
    condition: Condition,
}

/// What a clear leaves that does not get to its end.
#[derive(Clone, Copy, Debug)]
enum IfCutShort {
    /// Every value.
    KeepAll,
    /// Values that are out of date, or none.
    LeaveDamage,
}

impl<F: NorFlash> Storage<F> {
    const SLOTS: u32 = Region::<F>::SLOTS;

    /// The storage in the whole sectors of `range`, an address range of `flash`. It takes two at least; with fewer,
    /// every store is [`StorageError::Full`]. Nothing is read or written yet.
    pub fn new(flash: F, range: Range<u32>) -> Self {
        Self {
            region: Region::new(flash, range),
            log: None,
            condition: Condition::Damaged,
        }
    }

    /// Calls `found` once for every stored key, with its latest value, in the order in which those values were stored.
    ///
    /// # Errors
    /// [`StorageError::Corrupt`]: some values may be older than the latest, or missing. Those that were delivered have
    /// been stored once. [`StorageError::Flash`]: reading failed part way.
    pub async fn load(&mut self, found: &mut dyn FnMut(u16, u32)) -> Result<(), StorageError> {
        self.condition = Condition::Damaged;
        let Some(log) = self.find_log().await? else {
            return match self.region.unused().await? {
                Some(Unused::Erased) => {
                    self.condition = Condition::Blank;
                    Ok(())
                }
                Some(Unused::FirstWriteCutShort) => Ok(()),
                None => Err(StorageError::Corrupt),
            };
        };
        for slot in 0..log.used {
            yield_now().await;
            let Some(record) = self.read_if_latest(&log, slot).await? else {
                continue;
            };
            // Another firmware's records may have wider keys.
            if let Ok(key) = u16::try_from(record.key) {
                found(key, record.value);
            }
        }
        self.condition = log.condition;
        if log.is_trusted {
            Ok(())
        } else {
            Err(StorageError::Corrupt)
        }
    }

    /// How much of what was stored the last [`load`](Self::load) could read. Unlike its result, this counts a store that was
    /// cut short as damage.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Stores `value` under `key`. When it returns, the value is in flash and has been read back.
    ///
    /// # Errors
    /// The value that was stored before is still there; after [`StorageError::Flash`] it may be the new one.
    pub async fn store(&mut self, key: u16, value: u32) -> Result<Stored, StorageError> {
        let record = Record {
            key: key.into(),
            value,
        };
        let log = match self.log.take() {
            Some(log) => log,
            None => match self.find_log().await? {
                Some(log) => log,
                None => self.start_sector(None, None).await?,
            },
        };
        if self.latest_value(&log, record.key).await? == Some(record.value) {
            self.log = Some(log);
            return Ok(Stored::Unchanged);
        }
        let log = if log.is_whole && log.used < Self::SLOTS {
            self.region.write_record(log.sector, log.used, record).await?;
            Log {
                used: log.used + 1,
                ..log
            }
        } else {
            self.start_sector(Some(&log), Some(record)).await?
        };
        self.log = Some(log);
        Ok(Stored::Written)
    }

    /// Forgets every value, at once: a power cut leaves all or none.
    ///
    /// # Errors
    /// After [`StorageError::Flash`] there are all or none, too.
    pub fn clear(&mut self) -> impl Future<Output = Result<(), StorageError>> {
        self.clear_with(IfCutShort::KeepAll)
    }

    /// Forgets every value. However far it gets before a power cut or a failure, it leaves no value or
    /// [`Condition::Damaged`]; only flash that takes no change at all stays as it was.
    ///
    /// # Errors
    /// [`StorageError::Flash`]: flash could not be written.
    pub fn start_over(&mut self) -> impl Future<Output = Result<(), StorageError>> {
        self.clear_with(IfCutShort::LeaveDamage)
    }

    async fn clear_with(&mut self, if_cut_short: IfCutShort) -> Result<(), StorageError> {
        self.log = None;
        let log = self.find_log().await?;
        let is_clear = match &log {
            Some(log) => log.is_whole && log.used == 0,
            None => self.region.unused().await?.is_some(),
        };
        if is_clear {
            return Ok(());
        }
        if let (Some(log), IfCutShort::LeaveDamage) = (&log, if_cut_short) {
            self.region.retire(log.sector).await?;
        }
        self.log = Some(self.start_sector(log.as_ref(), None).await?);
        Ok(())
    }

    /// Puts the next sector in charge: with the newest record of every key in `old` and `newest`, or empty if there is
    /// no `newest`.
    async fn start_sector(&mut self, old: Option<&Log>, newest: Option<Record>) -> Result<Log, StorageError> {
        if self.region.sectors < 2 {
            return Err(StorageError::Full);
        }
        let (sector, sequence) = match old {
            Some(old) => {
                let next = old.sector + 1;
                let sequence = old.sequence.checked_add(1).ok_or(StorageError::Corrupt)?;
                (if next < self.region.sectors { next } else { 0 }, sequence)
            }
            None => (self.region.find_blank_sector().await?.unwrap_or(0), 1),
        };
        // Before the erase, so that a key that is offered again and again does not wear the flash.
        if let (Some(old), Some(newest)) = (old, newest)
            && !self.has_room_for(newest.key, old).await?
        {
            return Err(StorageError::Full);
        }
        // A sector whose erase was cut short may read as blank and yet not keep what is written to it, so one that may
        // have been in use is erased whatever it reads. In a region that was never used, an erase could only do harm.
        if old.is_some() || !self.region.is_blank(sector).await? {
            self.region.erase(sector).await?;
        }
        let mut used = 0;
        if let (Some(old), Some(newest)) = (old, newest) {
            for slot in 0..old.used {
                yield_now().await;
                if let Some(record) = self.read_if_carried(old, slot, newest.key).await? {
                    self.region.write_record(sector, used, record).await?;
                    used += 1;
                }
            }
        }
        if let Some(newest) = newest {
            self.region.write_record(sector, used, newest).await?;
            used += 1;
        }
        // A power cut before this leaves the old sector in charge, one after it the new sector.
        self.region.write_sequence(sector, sequence).await?;
        if let Some(old) = old {
            // If the new sector is ever lost, this tells that the old one is out of date.
            self.region.retire(old.sector).await?;
        }
        Ok(Log {
            sector,
            sequence,
            used,
            is_whole: true,
            is_trusted: true,
            condition: Condition::Whole,
        })
    }

    async fn has_room_for(&mut self, key: u32, log: &Log) -> Result<bool, StorageError> {
        if log.used < Self::SLOTS {
            return Ok(true);
        }
        for slot in 0..log.used {
            yield_now().await;
            if self.read_if_carried(log, slot, key).await?.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The record in `slot`, if it goes to the next sector together with a new one for `key`.
    async fn read_if_carried(
        &mut self,
        log: &Log,
        slot: u32,
        key: u32,
    ) -> Result<Option<Record>, StorageError> {
        let record = self.read_if_latest(log, slot).await?;
        Ok(record.filter(|record| record.key != key))
    }

    /// The sector with the highest sequence number, and its state.
    async fn find_log(&mut self) -> Result<Option<Log>, StorageError> {
        let mut newest: Option<(u32, u32)> = None;
        for sector in 0..self.region.sectors {
            if let Some(sequence) = self.region.read_sequence(sector).await?
                && newest.is_none_or(|(_, highest)| sequence > highest)
            {
                newest = Some((sector, sequence));
            }
        }
        let Some((sector, sequence)) = newest else {
            return Ok(None);
        };

        let mut used = 0;
        let mut records = 0;
        let mut ends_damaged = false;
        // Slots that held a record once, as far as that can be seen.
        let mut damaged = 0;
        for slot in 0..Self::SLOTS {
            match self.region.read_slot(sector, slot).await? {
                Slot::Blank => continue,
                Slot::Record(_) => {
                    // Records have no blank slots before them.
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
        let is_whole = records == used && !is_retired;
        let is_cut_short = records + 1 == used && ends_damaged && !is_retired;
        Ok(Some(Log {
            sector,
            sequence,
            used,
            is_whole,
            is_trusted: is_whole || is_cut_short,
            condition: match damaged {
                _ if is_retired => Condition::Damaged,
                0 => Condition::Whole,
                1 => Condition::OneRecordDamaged,
                _ => Condition::Damaged,
            },
        }))
    }

    /// The record in `slot`, unless it is damaged or a later one has its key.
    async fn read_if_latest(&mut self, log: &Log, slot: u32) -> Result<Option<Record>, StorageError> {
        let Slot::Record(record) = self.region.read_slot(log.sector, slot).await? else {
            return Ok(None);
        };
        for later in slot + 1..log.used {
            if self
                .region
                .read_value(log.sector, later, record.key)
                .await?
                .is_some()
            {
                return Ok(None);
            }
        }
        Ok(Some(record))
    }

    async fn latest_value(&mut self, log: &Log, key: u32) -> Result<Option<u32>, StorageError> {
        for slot in (0..log.used).rev() {
            if let Some(value) = self.region.read_value(log.sector, slot, key).await? {
                return Ok(Some(value));
            }
        }
        Ok(None)
    }
}
