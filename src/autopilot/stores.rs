//! Stores of values in flash: their operations, and when failures are announced.

use core::mem;

use crate::battery::{LEARNT_WORDS, LearntPack};
use crate::mavlink::ToStore;
use crate::memory::storage::StorageError;
use crate::pack::Pack;
use crate::parameter::Unsaved;
use crate::time::Instant;
use crate::wifi::WifiRecord;

/// Bits of a flash key for the instance of the pack.
const INSTANCE_BITS: u32 = 4;

/// Minimum interval between reports: loading a parameter file into a worn flash fails at every parameter.
const REPORT_INTERVAL_US: u64 = 5_000_000;

/// When the first of several changes has to wait for erased space, the others get this long to be reported with it.
const COLLECTION_US: u64 = 1_000_000;

/// A store of values in flash, apart from the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashStore {
    /// Parameters.
    Parameters,
    /// The signing key and time.
    Signing,
    /// Learnt data of the packs.
    Learnt,
    /// Names and passwords of networks.
    Wifi,
}

impl FlashStore {
    /// Every store, in the order of their turns.
    pub const ALL: [Self; 4] = [Self::Parameters, Self::Signing, Self::Learnt, Self::Wifi];

    /// Its content, in words for users.
    pub fn content(self) -> &'static str {
        match self {
            Self::Parameters => "Parameters",
            Self::Signing => "Signing",
            Self::Learnt => "Learnt battery data",
            Self::Wifi => "Wi-Fi settings",
        }
    }
}

/// An operation in flash.
#[derive(Clone, Debug, PartialEq)]
pub enum FlashJob {
    /// Store or clear parameters.
    Parameter(Unsaved),
    /// Store signing data.
    Signing(ToStore),
    /// Read the learnt data of a pack.
    ReadLearnt(PackIdentity),
    /// Store the learnt data of a pack.
    WriteLearnt(PackIdentity, LearntPack),
    /// Store a name or password.
    Wifi(WifiRecord),
}

impl FlashJob {
    /// The store that it is for.
    pub fn store(&self) -> FlashStore {
        match self {
            Self::Parameter(_) => FlashStore::Parameters,
            Self::Signing(_) => FlashStore::Signing,
            Self::ReadLearnt(_) | Self::WriteLearnt(..) => FlashStore::Learnt,
            Self::Wifi(_) => FlashStore::Wifi,
        }
    }
}

/// Result of a [`FlashJob`]; of a read, the words that are stored.
pub type FlashResult = Result<Option<[u32; LEARNT_WORDS]>, StorageError>;

/// The pack that an instance monitors, by its serial number (`BATT_SERIAL_NUM`), if set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackIdentity {
    /// The instance.
    pub pack: Pack,
    /// The serial number.
    pub serial_number: Option<i32>,
}

impl PackIdentity {
    /// Flash key: the instance, and above it the serial number plus one.
    pub fn key(self) -> u32 {
        let serial_number = self
            .serial_number
            .map_or(0, |number| number.wrapping_add(1) as u32);
        u32::from(self.pack.instance()) | serial_number << INSTANCE_BITS
    }
}

/// Failures to save parameters that have to be announced.
#[derive(Debug, Default)]
pub struct SaveReports {
    /// The latest error that was not reported.
    pending: Option<StorageError>,
    muted_until: Instant,
    /// Whether one was announced since everything was saved.
    was_announced: bool,
}

impl SaveReports {
    /// Adds an error that has to be reported.
    pub fn add(&mut self, error: StorageError, now: Instant) {
        if error == StorageError::NoErasedSpace && self.pending.is_none() {
            self.muted_until = self.muted_until.max(now.after_us(COLLECTION_US));
        }
        self.pending = Some(error);
    }

    /// The error to report at `now`, once.
    pub fn take(&mut self, now: Instant) -> Option<StorageError> {
        if now < self.muted_until {
            return None;
        }
        let report = self.pending.take()?;
        self.muted_until = now.after_us(REPORT_INTERVAL_US);
        Some(report)
    }

    /// The report that [`take`](Self::take) returned was announced: the failure may have been over by then.
    pub fn mark_announced(&mut self) {
        self.was_announced = true;
    }

    /// Whether a failure was announced; once, after everything was saved.
    pub fn take_recovery(&mut self) -> bool {
        mem::take(&mut self.was_announced)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::memory::storage::FlashFault;
    use crate::memory::storage::StorageError::{Full, NoErasedSpace};
    use crate::time::at_us;

    const SECOND_US: u64 = 1_000_000;
    const FLASH: StorageError = StorageError::Flash(FlashFault::NotVerified);

    #[test]
    // Requirement: L-18
    fn reports_are_five_seconds_apart_and_the_latest_is_kept() {
        let mut reports = SaveReports::default();
        reports.add(FLASH, Instant::EPOCH);
        assert_eq!(reports.take(Instant::EPOCH), Some(FLASH));
        reports.add(FLASH, at_us(SECOND_US));
        reports.add(Full, at_us(2 * SECOND_US));
        assert_eq!(reports.take(at_us(5 * SECOND_US - 1)), None);
        assert_eq!(reports.take(at_us(5 * SECOND_US)), Some(Full));
        reports.add(FLASH, at_us(10 * SECOND_US));
        assert_eq!(reports.take(at_us(10 * SECOND_US)), Some(FLASH));
    }

    #[test]
    fn changes_that_wait_for_erased_space_are_reported_together() {
        let mut reports = SaveReports::default();
        for ms in 0..20 {
            reports.add(NoErasedSpace, at_us(ms * 100_000));
            let expected = (ms == 10).then_some(NoErasedSpace);
            assert_eq!(reports.take(at_us(ms * 100_000)), expected, "{ms}");
        }
        assert_eq!(reports.take(at_us(6 * SECOND_US - 1)), None);
        assert_eq!(reports.take(at_us(6 * SECOND_US)), Some(NoErasedSpace));
    }

    #[test]
    fn recovery_is_reported_once_and_only_after_an_announcement() {
        let mut reports = SaveReports::default();
        reports.add(NoErasedSpace, Instant::EPOCH);
        assert_eq!(reports.take(at_us(SECOND_US)), Some(NoErasedSpace));
        assert!(!reports.take_recovery(), "not announced");
        reports.mark_announced();
        assert!(reports.take_recovery());
        assert!(!reports.take_recovery());
    }

    #[test]
    fn every_pack_and_serial_number_has_a_key_of_its_own() {
        let mut keys = HashSet::new();
        let serial_numbers = [-1, 0, 1, 2, 4095, 4096, 65_535, 16_777_214, 16_777_215];
        for pack in Pack::ALL {
            for number in serial_numbers {
                let serial_number = Some(number).filter(|number| *number >= 0);
                assert!(
                    keys.insert(PackIdentity { pack, serial_number }.key()),
                    "{pack:?}, {number}"
                );
            }
        }
        assert_eq!(
            PackIdentity {
                pack: Pack::Second,
                serial_number: None
            }
            .key(),
            1
        );
    }
}
