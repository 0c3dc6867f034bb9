//! Learnt data of the packs: read from flash, written to it, shown in parameters.

use super::stores::{FlashJob, FlashResult, FlashStore, PackIdentity};
use super::{Autopilot, Work};
use crate::battery::LearntPack;
use crate::log::{info, warn};
use crate::numbers::round_to_i32;
use crate::pack::Pack;
use crate::parameter::BatteryParameter;

const MILLIOHMS_PER_OHM: f32 = 1e3;

impl Autopilot {
    /// The next operation in flash. What is not saved comes before a read: the read may be of another pack in the same place.
    pub(super) fn next_learnt_job(&self) -> Option<FlashJob> {
        self.next_unsaved_learnt().or_else(|| {
            let mut packs = self.packs.order.iter().map(|(pack, _)| self.pack_identity(*pack));
            packs
                .find(|identity| !self.is_learnt_of(*identity))
                .map(FlashJob::ReadLearnt)
        })
    }

    /// Result of reading the stored data of a pack. A pack without usable data is learnt from the start.
    pub(super) fn learnt_read(&mut self, identity: PackIdentity, stored: FlashResult) {
        let PackIdentity { pack, serial_number } = identity;
        if let Err(error) = stored {
            warn!("battery {}: learnt data: {:?}", pack.number(), error);
        }
        // Meanwhile the serial number may have been set to another one, or the data erased.
        if identity != self.pack_identity(pack) || self.is_learnt_of(identity) {
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
        self.packs.bank.get_mut(pack).0.restore_learnt(learnt);
        // Another serial number follows with the next sample.
        if self.battery(pack).serial_number == serial_number {
            self.recording.describe(pack);
        }
        self.show_learnt(pack);
    }

    /// Whether the data under this flash key are of a pack that is monitored now: they never give way to others.
    pub fn is_learnt_in_use(&self, key: u32) -> bool {
        self.packs
            .order
            .iter()
            .any(|(pack, _)| self.pack_identity(*pack).key() == key)
    }

    /// The next write of learnt data; `None` while a failed write waits for its retry.
    pub(super) fn next_unsaved_learnt(&self) -> Option<FlashJob> {
        if self.waits_for_retry(FlashStore::Learnt) {
            return None;
        }
        self.packs.bank.monitors().find_map(|(pack, monitor)| {
            let learnt = *monitor.unsaved_learnt()?;
            let serial_number = learnt.serial_number();
            Some(FlashJob::WriteLearnt(
                PackIdentity { pack, serial_number },
                learnt,
            ))
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
        let identity = self.pack_identity(pack);
        let is_known = self.is_learnt_of(identity);
        let (monitor, _) = self.packs.bank.get_mut(pack);
        if !is_known {
            monitor.restore_learnt(LearntPack::of(identity.serial_number));
        }
        monitor.erase_learnt();
        self.keep_learnt(pack);
    }

    /// Whether the instance has what is learnt of this pack.
    fn is_learnt_of(&self, identity: PackIdentity) -> bool {
        let learnt = self.packs.bank.monitor(identity.pack).learnt();
        learnt.is_some_and(|learnt| learnt.serial_number() == identity.serial_number)
    }

    /// The pack that the parameters say the instance monitors.
    fn pack_identity(&self, pack: Pack) -> PackIdentity {
        PackIdentity {
            pack,
            serial_number: self.parameters.pack(pack).serial_number(),
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
