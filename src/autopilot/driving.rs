//! Motors, lamps and buzzer, and battery failsafes on their way to them.

use super::announcement::Announcement;
use super::autopilot::Autopilot;
use super::work::Work;
use crate::battery::{ArmState, FailsafeLevel};
use crate::log::info;
use crate::pack::Pack;
use crate::time::Instant;
use crate::vehicle::{FailsafeAction, Indication, SideDrives, VehicleSettings};

/// Outputs to motors, lamps and buzzer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// The motors.
    pub drives: SideDrives,
    /// Lamps and buzzer.
    pub indication: Indication,
}

impl Autopilot {
    /// Updates time-outs and ramps of the vehicle; has to be called every 20 ms, and at once after [`Work::DRIVE`].
    pub fn drive(&mut self, now: Instant) -> Outputs {
        let settings = VehicleSettings::from_parameters(&self.parameters);
        if let Some(event) = self.vehicle.update(now, &settings) {
            self.announce(Announcement::Vehicle(event));
        }
        self.follow_status();
        Outputs {
            drives: self.vehicle.drives(),
            indication: self.vehicle.indication(now),
        }
    }

    /// Takes the action that is set for a pack that has reached `level`.
    pub(super) fn act_on_failsafe(&mut self, pack: Pack, level: FailsafeLevel) {
        let action = FailsafeAction::from_parameters(&self.parameters, pack, level);
        if let Some(event) = self.vehicle.battery_failsafe(action) {
            self.announce(Announcement::Vehicle(event));
        }
        self.work |= Work::DRIVE;
    }

    /// Logs a change of the vehicle's status, and saves what has waited for disarming.
    fn follow_status(&mut self) {
        let status = self.vehicle.status();
        if status == self.known_status {
            return;
        }
        info!(
            "rover: {:?}, {:?}, alert {:?}",
            status.arm_state, status.mode, status.alert
        );
        if (self.known_status.arm_state, status.arm_state) == (ArmState::Armed, ArmState::Disarmed) {
            self.save_after_disarming();
        }
        self.known_status = status;
    }
}
