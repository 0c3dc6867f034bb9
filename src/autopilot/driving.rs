//! Motors, lamps and buzzer, and battery failsafes on their way to them.

use core::mem;

use super::announcement::{CrashLine, Notice};
use super::{Autopilot, Work};
use crate::announce::announced_text;
use crate::battery::{FailsafeLevel, SupplyEvent};
use crate::crash::{Interruption, RunEnd, headline};
use crate::log::info;
use crate::pack::Pack;
use crate::parameter::VehicleParameter;
use crate::recorder::dataflash::{ArmingMethod, ModeReason, Record, Subsystem};
use crate::time::Instant;
use crate::vehicle::ArmState;
use crate::vehicle::{
    Alert, FailsafeAction, Fitness, Indication, PowerLimit, SideDrives, VehicleEvent, VehicleSettings,
    VehicleStatus,
};

/// Time-outs of the driver above which arming is announced with them, in seconds.
const LONGEST_TIME_OUTS_S: [(VehicleParameter, f32); 2] = [
    (VehicleParameter::FsTimeout, 5.0),
    (VehicleParameter::FsGcsTimeout, 10.0),
];

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
        let event = self.vehicle.update(now, &settings);
        let begun = self.recording.follow(now, &self.parameters, &self.vehicle);
        if begun.is_some() {
            self.record_last_run();
            self.record_known_status();
        }
        if let Some(event) = event {
            self.record_failsafe(event);
            self.announce_vehicle(event);
        }
        self.follow_status(now);
        if let Some(failure) = self.recording.take_report() {
            self.announce(&failure, now);
        }
        Outputs {
            drives: self.vehicle.drives(),
            indication: self.vehicle.indication(now),
        }
    }

    /// Takes the most severe of the actions that are set for a pack that has reached these levels.
    pub(super) fn act_on_failsafe(&mut self, pack: Pack, reached: &[FailsafeLevel]) {
        self.recording.add(&Record::Error(Subsystem::BatteryFailsafe));
        self.mode_reason = ModeReason::BatteryFailsafe;
        let action = FailsafeAction::from_parameters(self.parameters.pack(pack), reached);
        if let Some(event) = self.vehicle.battery_failsafe(pack, action) {
            self.announce_vehicle(event);
        }
        self.work |= Work::DRIVE;
    }

    /// Logs a change of the vehicle's status, and saves what has waited for disarming.
    fn follow_status(&mut self, now: Instant) {
        let status = self.vehicle.status();
        let mode_reason = mem::replace(&mut self.mode_reason, ModeReason::Command);
        if status == self.known_status {
            return;
        }
        info!(
            "rover: {:?}, {:?}, alert {:?}",
            status.arm_state, status.mode, status.alert
        );
        if status.arm_state != self.known_status.arm_state {
            self.work |= Work::WATCHDOG;
        }
        match (self.known_status.arm_state, status.arm_state) {
            (ArmState::Armed, ArmState::Disarmed) => self.save_after_disarming(),
            (ArmState::Disarmed, ArmState::Armed) => {
                self.end_interruption(now);
                self.announce_long_time_outs(now);
                self.announce_idle_limits(now);
            }
            _ => {}
        }
        self.record_status(status, mode_reason);
        self.known_status = status;
    }

    /// The rover is armed: interruptions are over. One that is still a danger to the drive is announced once more.
    fn end_interruption(&mut self, now: Instant) {
        match mem::take(&mut self.last_run.end) {
            RunEnd::Interrupted(Interruption::PowerDip) => self.announce(&Notice::PowerWentOff, now),
            RunEnd::Interrupted(Interruption::Crash) => {
                let running = self.identity().firmware_hash;
                let crash = self.last_run.crash.as_ref();
                if let Some(text) = crash.map(|crash| headline(crash, running)) {
                    self.announce(&CrashLine(&text), now);
                }
            }
            _ => {}
        }
    }

    /// Records how the last run ended, as a file begins.
    fn record_last_run(&mut self) {
        if self.recording.crash_is_due()
            && let Some(crash) = &self.last_run.crash
        {
            self.recording.add(&Record::Crash(crash));
        }
        if self.last_run.end != RunEnd::Interrupted(Interruption::Crash) {
            let recording = &mut self.recording;
            self.last_run
                .report(None, &mut |notice| recording.add_text(&announced_text(notice)));
        }
    }

    /// Announces time-outs by which an armed rover goes on for long without a driver.
    fn announce_long_time_outs(&mut self, now: Instant) {
        for (parameter, longest_s) in LONGEST_TIME_OUTS_S {
            let seconds = self.parameters.get(parameter);
            if seconds > longest_s {
                self.announce(&Notice::LongTimeOut { parameter, seconds }, now);
            }
        }
    }

    /// Announces power limits that do nothing, since the power is not known.
    fn announce_idle_limits(&mut self, now: Instant) {
        for pack in Pack::ALL {
            let is_limited = PowerLimit::from_parameters(self.parameters.pack(pack)).is_some();
            if is_limited && self.packs.kind(pack).is_some() && self.packs.bank.power_w(pack).is_none() {
                self.announce_supply(pack, &SupplyEvent::PowerUnknown, now);
            }
        }
    }

    /// Records the status in which a file begins. Of arming, only what the file comes too late for.
    fn record_known_status(&mut self) {
        let status = self.known_status;
        self.recording.add(&Record::Mode {
            mode: status.mode,
            reason: ModeReason::Unknown,
        });
        if status.arm_state == ArmState::Armed {
            self.record_arming(status);
        }
    }

    /// Records what has changed of the status.
    fn record_status(&mut self, status: VehicleStatus, mode_reason: ModeReason) {
        if status.arm_state != self.known_status.arm_state {
            self.record_arming(status);
        }
        if status.mode != self.known_status.mode {
            self.recording.add(&Record::Mode {
                mode: status.mode,
                reason: mode_reason,
            });
        }
    }

    fn record_arming(&mut self, status: VehicleStatus) {
        let method = match status.alert {
            Alert::Terminated => ArmingMethod::Termination,
            Alert::None | Alert::TimedOut => ArmingMethod::Command,
        };
        self.recording.add(&Record::Arm {
            state: status.arm_state,
            enabled_checks: self.parameters.get_whole(VehicleParameter::ArmingCheck) as u32,
            forced: (status.arm_state, status.fitness) == (ArmState::Armed, Fitness::Forced),
            method,
        });
        self.recording.add(&Record::Event(status.arm_state));
        self.work |= Work::LOG;
    }

    /// Records a failsafe of sticks or ground stations.
    fn record_failsafe(&mut self, event: VehicleEvent) {
        let (subsystem, reason) = match event {
            VehicleEvent::ControlsTimedOut => (Subsystem::ControlsFailsafe, ModeReason::ControlsTimedOut),
            VehicleEvent::GroundStationsTimedOut => (
                Subsystem::GroundStationFailsafe,
                ModeReason::GroundStationsTimedOut,
            ),
            VehicleEvent::NeedsPosition(_) | VehicleEvent::Terminated => return,
        };
        self.mode_reason = reason;
        self.recording.add(&Record::Error(subsystem));
    }
}
