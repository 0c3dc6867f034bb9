//! The rover as a whole.

use super::controls::Controls;
use super::ramp::Ramp;
use super::timed_input::TimedInput;
use super::{
    Colour, FailsafeAction, Indication, Lever, LeverName, Mode, SideDrives, Tone, VehicleEvent,
    VehicleSettings,
};
use crate::battery::{ArmState, FailsafeLevel};

/// The buzzer, in microseconds: one long tone when arming is refused.
const REFUSED_TONE_US: u64 = 500_000;
/// One short tone every two seconds as a warning.
const WARNING_PERIOD_US: u64 = 2_000_000;
/// Three short tones in each second, with pauses as long between them, when it is urgent.
const URGENT_PERIOD_US: u64 = 1_000_000;
const URGENT_TONES: u64 = 3;
const SHORT_TONE_US: u64 = 100_000;

/// Why the rover was not armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmingRefused {
    /// A check has failed.
    Unfit,
    /// A failsafe has disarmed it for good.
    Terminated,
    /// The board is about to restart.
    Restarting,
}

/// Whoever drove the rover is not heard any more, so the mode can't be left for one that drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModeRefused;

/// How bad it is, for ground stations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Alert {
    /// Nothing is wrong.
    #[default]
    None,
    /// A failsafe is active: a pack is low or critical, or control inputs or ground stations have fallen silent.
    Failsafe,
    /// A failsafe has disarmed the rover for good.
    Terminated,
}

/// What ground stations are told of the rover.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VehicleStatus {
    /// Its mode.
    pub mode: Mode,
    /// Whether it may move.
    pub arm_state: ArmState,
    /// How bad it is.
    pub alert: Alert,
}

/// The rover: what it is told, what befalls it, and what its motors, lamps and buzzer do about it.
///
/// It starts disarmed, in [`Mode::Hold`]. Times are microseconds since some start.
#[derive(Clone, Debug, Default)]
pub struct Vehicle {
    mode: Mode,
    arm_state: ArmState,
    controls: Controls,
    ground_stations: TimedInput<()>,
    throttle: Ramp,
    /// The worst level of all packs.
    battery: FailsafeLevel,
    /// The most severe action since all packs were well.
    action: Option<FailsafeAction>,
    refused_at_us: Option<u64>,
    is_restarting: bool,
}

impl Vehicle {
    /// A rover that was just switched on.
    pub fn new() -> Self {
        Self::default()
    }

    /// Arms it, if `is_fit` says that all checks have passed or need not.
    ///
    /// # Errors
    /// It stays disarmed, and the buzzer tells.
    pub fn arm(&mut self, now_us: u64, is_fit: bool) -> Result<(), ArmingRefused> {
        let refused = if self.is_terminated() {
            ArmingRefused::Terminated
        } else if self.is_restarting {
            ArmingRefused::Restarting
        } else if !is_fit {
            ArmingRefused::Unfit
        } else {
            self.arm_state = ArmState::Armed;
            self.controls.arm();
            self.refused_at_us = None;
            return Ok(());
        };
        self.refused_at_us = Some(now_us);
        Err(refused)
    }

    /// Disarms it: the motors roll freely.
    pub fn disarm(&mut self) {
        self.arm_state = ArmState::Disarmed;
        self.throttle = Ramp::default();
        self.controls.disarm();
        self.ground_stations.clear_time_out();
    }

    /// The board is about to restart: it must not be armed meanwhile.
    pub fn prepare_restart(&mut self) {
        self.is_restarting = true;
    }

    /// The lever that is deflected, so that the motors would turn as soon as the rover is armed.
    pub fn deflected_lever(&self) -> Option<LeverName> {
        self.controls.deflected()
    }

    /// Changes the mode, also from one that a battery's failsafe has set.
    ///
    /// # Errors
    /// It holds because control inputs or ground stations have fallen silent; they have to come back first.
    pub fn set_mode(&mut self, mode: Mode) -> Result<(), ModeRefused> {
        if mode != Mode::Hold && self.is_abandoned() {
            return Err(ModeRefused);
        }
        self.enter(mode);
        Ok(())
    }

    /// The driver's levers: throttle ahead and steering to the right are positive. Who moves one is a ground station, so
    /// that counts as a heartbeat of one that is monitored.
    pub fn control(&mut self, received_us: u64, throttle: Lever, steering: Lever) {
        let is_driver = self.controls.take(received_us, throttle, steering);
        if is_driver && self.ground_stations.value().is_some() {
            self.ground_stations.receive(received_us, ());
        }
    }

    /// The heartbeat of a ground station.
    pub fn ground_station_seen(&mut self, received_us: u64) {
        self.ground_stations.receive(received_us, ());
    }

    /// A pack has reached a failsafe level for which the owner wants this. The most severe action so far wins; one that is
    /// as severe is done again.
    pub fn battery_failsafe(&mut self, action: FailsafeAction) -> Option<VehicleEvent> {
        if self.action.is_some_and(|worst| action < worst) {
            return None;
        }
        self.action = Some(action);
        match action {
            FailsafeAction::Warn => return None,
            FailsafeAction::Terminate => {
                self.disarm();
                return Some(VehicleEvent::Terminated);
            }
            _ => self.enter(Mode::Hold),
        }
        action
            .needs_position()
            .then_some(VehicleEvent::NeedsPosition(action))
    }

    /// The worst failsafe level of all packs. When all are well again, because the battery was reset, what was done about
    /// it is over, too.
    pub fn follow_batteries(&mut self, worst: FailsafeLevel) {
        self.battery = worst;
        if worst == FailsafeLevel::None {
            self.action = None;
        }
    }

    /// Lets time pass, and tells if something has failed by it.
    pub fn update(&mut self, now_us: u64, settings: &VehicleSettings) -> Option<VehicleEvent> {
        let event = self.fail(now_us, settings);
        if event.is_some() {
            self.enter(Mode::Hold);
        }
        if self.is_driving() {
            self.throttle
                .follow(now_us, self.controls.throttle(), settings.slew_rate_per_s);
        }
        event
    }

    /// What has fallen silent, one at a time.
    fn fail(&mut self, now_us: u64, settings: &VehicleSettings) -> Option<VehicleEvent> {
        if self
            .controls
            .times_out(now_us, settings.timeout_us, self.arm_state)
        {
            return Some(VehicleEvent::ControlsSilent);
        }
        self.ground_stations
            .times_out(now_us, settings.ground_station_timeout_us, self.arm_state)
            .then_some(VehicleEvent::GroundStationsSilent)
    }

    fn enter(&mut self, mode: Mode) {
        if mode != self.mode {
            self.throttle = Ramp::default();
        }
        self.mode = mode;
    }

    /// What the motors are told now.
    pub fn drives(&self) -> SideDrives {
        match (self.arm_state, self.mode) {
            (ArmState::Disarmed, _) => SideDrives::COAST,
            (ArmState::Armed, Mode::Hold) => SideDrives::BRAKE,
            (ArmState::Armed, Mode::Manual) => {
                SideDrives::mixed(self.throttle.value(), self.controls.steering())
            }
        }
    }

    /// How much of their power the motors take, from 0 to 1: what a synthetic current is estimated from.
    pub fn effort(&self) -> f32 {
        self.drives().effort()
    }

    /// What the lamps and the buzzer show at `now_us`.
    pub fn indication(&self, now_us: u64) -> Indication {
        Indication {
            colour: self.colour(),
            tone: if self.sounds(now_us) {
                Tone::Sounding
            } else {
                Tone::Silent
            },
        }
    }

    fn colour(&self) -> Colour {
        if self.is_urgent() {
            Colour::Red
        } else if self.is_warning() {
            Colour::Yellow
        } else if self.arm_state == ArmState::Armed {
            Colour::Blue
        } else {
            Colour::Green
        }
    }

    fn sounds(&self, now_us: u64) -> bool {
        let was_refused = |at_us| now_us.saturating_sub(at_us) < REFUSED_TONE_US;
        if self.refused_at_us.is_some_and(was_refused) {
            true
        } else if self.is_urgent() {
            let slot = now_us % URGENT_PERIOD_US / SHORT_TONE_US;
            slot.is_multiple_of(2) && slot < 2 * URGENT_TONES
        } else {
            self.is_warning() && now_us % WARNING_PERIOD_US < SHORT_TONE_US
        }
    }

    fn is_urgent(&self) -> bool {
        self.is_terminated() || self.battery == FailsafeLevel::Critical
    }

    fn is_warning(&self) -> bool {
        self.battery > FailsafeLevel::None || self.is_abandoned()
    }

    /// What ground stations are told.
    pub fn status(&self) -> VehicleStatus {
        VehicleStatus {
            mode: self.mode,
            arm_state: self.arm_state,
            alert: if self.is_terminated() {
                Alert::Terminated
            } else if self.battery >= FailsafeLevel::Low || self.is_abandoned() {
                Alert::Failsafe
            } else {
                Alert::None
            },
        }
    }

    /// Whether it may move.
    pub fn arm_state(&self) -> ArmState {
        self.arm_state
    }

    /// Whether a failsafe has disarmed it for good.
    pub fn is_terminated(&self) -> bool {
        self.action == Some(FailsafeAction::Terminate)
    }

    fn is_driving(&self) -> bool {
        self.arm_state == ArmState::Armed && self.mode == Mode::Manual
    }

    /// Whether control inputs or ground stations have fallen silent.
    fn is_abandoned(&self) -> bool {
        self.controls.have_timed_out() || self.ground_stations.has_timed_out()
    }
}

#[cfg(test)]
mod tests;
