//! What is learnt of the packs: read from flash, written to it, shown in parameters.

use super::announcement::Announcement;
use super::saving::log_failure;
use super::{Autopilot, Work};
use crate::battery::{LEARNT_WORDS, LearntPack, PackSettings};
use crate::log::{info, warn};
use crate::memory::save_state::SaveState;
use crate::memory::storage::StorageError;
use crate::numbers::round_to_i32;
use crate::pack::Pack;
use crate::parameter::BatteryParameter;
use crate::time::Instant;

/// Bits of a flash key for the instance of the pack.
const INSTANCE_BITS: u32 = 4;

const MILLIOHMS_PER_OHM: f32 = 1e3;

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

/// What has to be done in flash for what is learnt of the packs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LearntJob {
    /// Write what is learnt of a pack.
    Write(PackIdentity, LearntPack),
    /// Read what is learnt of a pack.
    Read(PackIdentity),
}

impl Autopilot {
    /// What has to be done in flash next. What is not saved comes before a read: the read may be of another pack in the
    /// same place.
    pub fn next_learnt_job(&mut self, now: Instant) -> Option<LearntJob> {
        self.learnt_save.take_retry(now);
        self.next_unsaved_learnt().or_else(|| {
            let mut packs = self.packs.order.iter().map(|(pack, _)| self.identity(*pack));
            packs
                .find(|identity| !self.is_learnt_of(*identity))
                .map(LearntJob::Read)
        })
    }

    /// Result of reading what is stored of a pack. A pack of which nothing usable is stored is learnt from the start.
    pub fn learnt_read(
        &mut self,
        identity: PackIdentity,
        stored: Result<Option<[u32; LEARNT_WORDS]>, StorageError>,
    ) {
        let PackIdentity { pack, serial_number } = identity;
        if let Err(error) = stored {
            warn!("battery {}: learnt data: {:?}", pack.number(), error);
        }
        // Meanwhile the serial number may have been set to another one, or the data erased.
        if identity != self.identity(pack) || self.is_learnt_of(identity) {
            return;
        }
        let learnt = stored
            .ok()
            .flatten()
            .and_then(|words| LearntPack::from_words(&words));
        let learnt = learnt.filter(|learnt| learnt.serial_number() == serial_number);
        info!(
            "battery {}: learnt data are stored: {}",
            pack.number(),
            learnt.is_some()
        );
        let learnt = learnt.unwrap_or(LearntPack::of(serial_number));
        self.packs.bank.monitor(pack).restore_learnt(learnt);
        // Another serial number follows with the next sample.
        if self.battery(pack).serial_number == serial_number {
            self.recording.describe(pack);
        }
        self.show_learnt(pack);
    }

    /// Result of writing what is learnt of a pack. A failed write is repeated after a minute.
    pub fn learnt_written(
        &mut self,
        pack: Pack,
        learnt: &LearntPack,
        result: Result<(), StorageError>,
        now: Instant,
    ) {
        let Err(error) = result else {
            info!("battery {}: learnt data saved", pack.number());
            self.learnt_save = SaveState::Saved;
            self.packs.bank.monitor(pack).mark_learnt_saved(learnt);
            return;
        };
        log_failure("learnt data", error);
        if let Some(error) = self.learnt_save.fail(error, now) {
            self.announce(Announcement::LearntNotSaved(error), now);
        }
    }

    /// Whether the data under this flash key are of a pack that is monitored now: they never give way to others.
    pub fn is_learnt_in_use(&self, key: u32) -> bool {
        self.packs
            .order
            .iter()
            .any(|(pack, _)| self.identity(*pack).key() == key)
    }

    /// What is learnt and has to be written; `None` while a failed write waits for its retry.
    pub(super) fn next_unsaved_learnt(&self) -> Option<LearntJob> {
        if self.learnt_save.is_waiting() {
            return None;
        }
        self.packs.bank.monitors().find_map(|(pack, monitor)| {
            let learnt = *monitor.unsaved_learnt()?;
            let serial_number = learnt.serial_number();
            Some(LearntJob::Write(PackIdentity { pack, serial_number }, learnt))
        })
    }

    /// Shows and saves what a tick has changed.
    pub(super) fn keep_learnt(&mut self, pack: Pack) {
        if self.packs.bank.monitor(pack).unsaved_learnt().is_some() {
            self.work |= Work::SAVE;
            self.show_learnt(pack);
        }
    }

    /// Erases what is learnt of the pack, also if it was not read yet: what the instance has may be of another pack.
    pub(super) fn erase_learnt(&mut self, pack: Pack) {
        let identity = self.identity(pack);
        let is_known = self.is_learnt_of(identity);
        let monitor = self.packs.bank.monitor(pack);
        if !is_known {
            monitor.restore_learnt(LearntPack::of(identity.serial_number));
        }
        monitor.forget_learnt();
        self.keep_learnt(pack);
    }

    /// Whether the instance has what is learnt of this pack.
    fn is_learnt_of(&self, identity: PackIdentity) -> bool {
        let mut monitors = self.packs.bank.monitors();
        let monitor = monitors.find(|(pack, _)| *pack == identity.pack);
        let learnt = monitor.and_then(|(_, monitor)| monitor.learnt());
        learnt.is_some_and(|learnt| learnt.serial_number() == identity.serial_number)
    }

    /// The pack that the parameters say the instance monitors.
    fn identity(&self, pack: Pack) -> PackIdentity {
        PackIdentity {
            pack,
            serial_number: PackSettings::serial_number(&self.parameters, pack),
        }
    }

    /// Shows what is learnt of the pack in its parameters.
    pub(super) fn show_learnt(&mut self, pack: Pack) {
        let learnt = self.packs.bank.monitor(pack).shown_learnt();
        let capacity_mah = learnt.and_then(LearntPack::capacity_mah).unwrap_or(0.0);
        let resistance_ohm = learnt.and_then(LearntPack::resistance_ohm).unwrap_or(0.0);
        let shown = [
            (BatteryParameter::LrnCap, round_to_i32(capacity_mah) as f32),
            (BatteryParameter::LrnRes, resistance_ohm * MILLIOHMS_PER_OHM),
        ];
        for (parameter, value) in shown {
            self.parameters.show(parameter.of(pack), value);
        }
        self.report_changes(None);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

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
