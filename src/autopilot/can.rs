//! The CAN bus: what comes from it.

use super::Autopilot;
use super::announcement::Announcement;
use crate::log::info;
use crate::sensor::{CanEvent, CanSettings, CanSetup, CanStatus, MonitorKind};
use crate::time::Instant;

impl Autopilot {
    /// How the node on the CAN bus is set up; `None` while the bus is not in use.
    pub fn can_setup(&self) -> Option<CanSetup> {
        CanSetup::from_parameters(&self.parameters, &self.identity)
    }

    /// What may change of the node's settings at any time.
    pub fn can_settings(&self) -> CanSettings {
        CanSettings::new(
            self.packs.of_kind(MonitorKind::Can),
            &self.parameters,
            &self.identity,
            self.vehicle.arm_state(),
        )
    }

    /// Takes what came from the CAN bus at `now`.
    pub fn add_can_event(&mut self, event: &CanEvent, now: Instant) {
        match event {
            CanEvent::Reading(pack, reading) => {
                self.packs.add(*pack, MonitorKind::Can, Ok(*reading), now);
            }
            CanEvent::Controller(index, reading) => self.add_controller_reading(*index, *reading, now),
            CanEvent::Announce(notice) => self.announce(Announcement::CanNode(*notice), now),
        }
    }

    /// Takes what is known of the bus's controller, and announces what is news.
    pub fn set_can_status(&mut self, status: &CanStatus, now: Instant) {
        let limit = &self.limit;
        let is_due = |report| limit.allows_one(Announcement::Can(report).kind(), now);
        if let Some(report) = self.can.news(status, now, is_due) {
            info!("CAN: {:?}, {} frames not sent", report, status.unsent_frames);
            self.announce(Announcement::Can(report), now);
        }
    }
}
