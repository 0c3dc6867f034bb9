//! Vehicle state machine.

use core::mem;

use super::controls::Controls;
use super::driver::{Admitted, DriverSeat};
use super::failsafe::Effect;
use super::motor::{Ramp, Reversals};
use super::power_limit::PowerLimiter;
use super::timed_input::TimedInput;
use super::{
    Alert, AnotherDrives, ArmState, BatteryAlert, Colour, DriverId, FailsafeAction, Fitness, Indication,
    Mode, PowerLimit, Presence, Restart, SideDrives, Stick, StickInput, Tone, VehicleEvent, VehicleSettings,
    VehicleStatus,
};
use crate::pack::{Pack, PackSet};
use crate::parameter::StickChannels;
use crate::time::Instant;

/// Buzzer: one long tone when arming is refused, in microseconds.
const REFUSED_TONE_US: u64 = 500_000;
/// One short tone per period as a warning.
const WARNING_PERIOD_US: u64 = 2_000_000;
/// Three short tones per period, with pauses of equal length, when urgent.
const URGENT_PERIOD_US: u64 = 1_000_000;
const URGENT_TONES: u64 = 3;
const SHORT_TONE_US: u64 = 100_000;
/// A disarmed rover with a pack below its critical threshold is forgotten after this long without a station or a stick, in
/// microseconds.
const FORGOTTEN_AFTER_US: u64 = 600_000_000;
/// Its periods of three short tones and of a flash of the lamps: the rest would drain the pack.
const FORGOTTEN_PERIOD_US: u64 = 60_000_000;
const FLASH_PERIOD_US: u64 = 10_000_000;
const FLASH_US: u64 = 100_000;

/// Why the rover was not armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmingRefused {
    /// A check has failed.
    Unfit,
    /// A failsafe has terminated the drive.
    Terminated,
    /// The board is about to restart.
    Restarting,
}

/// Mode change denied: control inputs or ground stations have timed out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModeRefused;

/// Vehicle state machine: commands, control inputs and failsafes in; outputs for motors, lamps and buzzer out.
///
/// Starts disarmed, in [`Mode::Hold`].
#[derive(Clone, Debug, Default)]
pub struct Vehicle {
    mode: Mode,
    arm_state: ArmState,
    /// Number of armings. It wraps.
    armings: u8,
    /// When it was armed last.
    fitness: Fitness,
    controls: Controls,
    seat: DriverSeat,
    /// Another driver has taken over from one that was silent with a deflected stick; the next update treats that as a time-out.
    driver_lost: bool,
    /// Channels of the settings when it was disarmed last.
    channels: StickChannels,
    ground_stations: TimedInput<()>,
    throttle: Ramp,
    power: PowerLimiter,
    reversals: Reversals,
    /// The most urgent alert of all packs.
    battery_alert: BatteryAlert,
    /// Packs that are not being charged and are below their critical threshold.
    below_critical: PackSet,
    /// When it was armed, a station or a stick was there, or no pack was below its critical threshold.
    attended_at: Instant,
    /// Packs whose failsafe has terminated the drive and that still have a failsafe level.
    terminated_by: PackSet,
    refused_at: Option<Instant>,
    pending_restart: Option<Restart>,
}

impl Vehicle {
    /// The state at boot.
    pub fn new() -> Self {
        Self::default()
    }

    /// Arms, unless it is unfit.
    ///
    /// # Errors
    /// It stays disarmed, and the buzzer sounds.
    pub fn arm(&mut self, now: Instant, fitness: Fitness) -> Result<(), ArmingRefused> {
        let refused = if self.is_terminated() {
            ArmingRefused::Terminated
        } else if self.pending_restart.is_some() {
            ArmingRefused::Restarting
        } else if fitness == Fitness::Unfit {
            ArmingRefused::Unfit
        } else {
            self.arm_state = ArmState::Armed;
            self.armings = self.armings.wrapping_add(1);
            self.fitness = fitness;
            self.controls.close();
            self.refused_at = None;
            return Ok(());
        };
        self.refused_at = Some(now);
        Err(refused)
    }

    /// Disarms: the motors coast.
    pub fn disarm(&mut self) {
        self.arm_state = ArmState::Disarmed;
        self.throttle = Ramp::default();
        self.power = PowerLimiter::default();
        self.controls.disarm();
        self.seat.vacate();
        self.driver_lost = false;
        self.ground_stations.clear_time_out();
    }

    /// Prevents arming until the pending restart of the board.
    pub fn prepare_restart(&mut self, restart: Restart) {
        self.pending_restart = self.pending_restart.max(Some(restart));
    }

    /// A deflected stick: the motors would turn on arming.
    pub fn deflected_stick(&self) -> Option<Stick> {
        self.controls.deflected()
    }

    /// The number of a stick's channel, from 1.
    pub fn channel_number(&self, stick: Stick) -> u8 {
        let channel = match stick {
            Stick::Throttle => &self.channels.throttle,
            Stick::Steering => &self.channels.steering,
        };
        channel.number()
    }

    /// Changes the mode, also out of a battery failsafe's Hold.
    ///
    /// # Errors
    /// Control inputs or ground stations have timed out and not resumed: only Hold is allowed.
    pub fn set_mode(&mut self, mode: Mode) -> Result<(), ModeRefused> {
        if mode != Mode::Hold && self.has_timed_out() {
            return Err(ModeRefused);
        }
        if mode == Mode::Manual && self.mode != mode {
            self.controls.close();
        }
        self.enter(mode);
        Ok(())
    }

    /// A control message: throttle ahead and steering to the right are positive. If it shows that a ground station is there, it also
    /// counts as a heartbeat if these are monitored. Returns a stick that its driver has to centre before it drives, if that has to
    /// be reported now.
    ///
    /// # Errors
    /// It has no effect: another station drives.
    pub fn control(
        &mut self,
        from: DriverId,
        received_at: Instant,
        presence: Presence,
        throttle: StickInput,
        steering: StickInput,
    ) -> Result<Option<Stick>, AnotherDrives> {
        self.attended_at = self.attended_at.max(received_at);
        let was_driven = self.seat.is_taken() && self.arm_state == ArmState::Armed;
        if let Admitted::NewDriver(sticks) = self.seat.admit(from, received_at, throttle, steering)? {
            self.driver_lost |= was_driven && self.controls.deflected().is_some();
            self.controls.hand_over(sticks);
        }
        let is_driver = self.controls.receive(received_at, throttle, steering);
        if is_driver && self.controls.deflected().is_some() {
            self.seat.note_deflected(received_at);
        }
        if is_driver && presence == Presence::GroundStation && self.ground_stations.value().is_some() {
            self.ground_stations.receive(received_at, ());
        }
        let waiting = self.controls.waiting().filter(|_| self.is_driving());
        Ok(waiting.filter(|_| self.seat.may_report(received_at)))
    }

    /// Reads throttle and steering from the pulses of all channels, in microseconds.
    pub fn stick_inputs(&self, pulses_us: &[u16]) -> (StickInput, StickInput) {
        let StickChannels { throttle, steering } = &self.channels;
        (
            StickInput::of_channel(throttle, pulses_us),
            StickInput::of_channel(steering, pulses_us),
        )
    }

    /// The stations of a link are gone. A driver among them leaves the seat, and its sticks are neutral.
    pub fn close_link(&mut self, link: u16) {
        if self.seat.close_link(link) {
            self.controls.centre();
        }
    }

    /// A ground station's heartbeat.
    pub fn ground_station_seen(&mut self, received_at: Instant) {
        self.attended_at = self.attended_at.max(received_at);
        self.ground_stations.receive(received_at, ());
    }

    /// Executes the action of a failsafe level that a pack has reached, unless the drive was terminated before. A driver who
    /// has left Hold is held again.
    pub fn battery_failsafe(&mut self, pack: Pack, action: FailsafeAction) -> Option<VehicleEvent> {
        match action.effect() {
            Effect::None => None,
            Effect::Hold if self.is_terminated() => None,
            Effect::Hold => {
                self.enter(Mode::Hold);
                action
                    .needs_position()
                    .then_some(VehicleEvent::NeedsPosition(action))
            }
            Effect::Terminate => {
                self.disarm();
                self.terminated_by.insert(pack);
                Some(VehicleEvent::Terminated)
            }
        }
    }

    /// Whether an action would do more to the armed rover than is done now.
    pub fn would_act(&self, action: FailsafeAction) -> bool {
        let present = match self.mode {
            Mode::Hold => Effect::Hold,
            Mode::Manual => Effect::None,
        };
        self.arm_state == ArmState::Armed && action.effect() > present
    }

    /// Updates the packs that have a failsafe level, and the most urgent alert of all. A termination ends when
    /// each pack that has caused it has none, after a battery reset or swap.
    pub fn update_batteries(&mut self, at_a_level: PackSet, alert: BatteryAlert) {
        self.battery_alert = alert;
        self.terminated_by = self.terminated_by & at_a_level;
    }

    /// Updates whether this pack is not being charged and below its critical threshold.
    pub fn update_below_critical(&mut self, pack: Pack, is_below: bool) {
        if is_below {
            self.below_critical.insert(pack);
        } else {
            self.below_critical.remove(pack);
        }
    }

    /// Follows changed channels of the sticks while disarmed. Positions from before mean something else now.
    fn follow_channels(&mut self, channels: StickChannels) {
        if self.arm_state == ArmState::Disarmed && channels != self.channels {
            self.channels = channels;
            self.controls.require_neutral();
        }
    }

    /// Updates time-outs, channels of the sticks and the slew rate limiter. Returns an event if an input has timed out.
    pub fn update(&mut self, now: Instant, settings: &VehicleSettings) -> Option<VehicleEvent> {
        self.follow_channels(settings.channels);
        if self.arm_state == ArmState::Armed || self.below_critical.is_empty() {
            self.attended_at = now;
        }
        self.seat.expire(now, settings.timeout_us);
        let event = self.check_time_outs(now, settings);
        if event.is_some() {
            self.enter(Mode::Hold);
        }
        if self.is_driving() {
            self.throttle
                .follow(now, self.controls.throttle(), settings.slew_rate_per_s);
            self.reversals.follow(now, self.mixed());
        }
        event
    }

    /// The input that has timed out; if both have, the second is returned by the next call.
    fn check_time_outs(&mut self, now: Instant, settings: &VehicleSettings) -> Option<VehicleEvent> {
        let driver_lost = mem::take(&mut self.driver_lost);
        if self.controls.times_out(now, settings.timeout_us, self.arm_state) || driver_lost {
            return Some(VehicleEvent::ControlsTimedOut);
        }
        self.ground_stations
            .times_out(now, settings.ground_station_timeout_us, self.arm_state)
            .then_some(VehicleEvent::GroundStationsTimedOut)
    }

    fn enter(&mut self, mode: Mode) {
        if mode != self.mode {
            self.throttle = Ramp::default();
        }
        self.mode = mode;
    }

    /// Limits the motors while armed, by a pack's limit and what is supplied by it now, in watts, `dt_s` seconds after the
    /// last call; while that is unknown its limit holds. Returns whether [`power_limit_w`](Self::power_limit_w) is to be
    /// announced.
    pub fn limit_power(
        &mut self,
        pack: Pack,
        dt_s: f32,
        limit: Option<PowerLimit>,
        power_w: Option<f32>,
    ) -> bool {
        self.arm_state == ArmState::Armed && self.power.follow(pack, dt_s, limit, power_w)
    }

    /// The power to which a pack limits the motors, in watts, as it was announced; `None` if it does not.
    pub fn power_limit_w(&self, pack: Pack) -> Option<u16> {
        self.power.limits_to_w(pack)
    }

    /// Whether the motors are not the cause of a pack's load, or can't be limited any further.
    pub fn has_exhausted_power_limit(&self, pack: Pack) -> bool {
        self.arm_state == ArmState::Disarmed || self.power.is_exhausted(pack)
    }

    /// Present motor outputs.
    pub fn drives(&self) -> SideDrives {
        match (self.arm_state, self.mode) {
            (ArmState::Disarmed, _) => SideDrives::COAST,
            (ArmState::Armed, Mode::Hold) => SideDrives::BRAKE,
            (ArmState::Armed, Mode::Manual) => self.mixed().limited(&self.reversals),
        }
    }

    /// The drives of both sides that the sticks ask for, within the power limits.
    fn mixed(&self) -> SideDrives {
        SideDrives::mixed(
            self.throttle.value(),
            self.controls.steering(),
            self.power.share(),
        )
    }

    /// Share of the motors' full power, from 0 to 1, for the synthetic current sensor.
    pub fn effort(&self) -> f32 {
        self.drives().effort()
    }

    /// Indication of lamps and buzzer at `now`.
    pub fn indication(&self, now: Instant) -> Indication {
        // The lamps keep their colour in the boot loader, where it would mean nothing.
        if self.pending_restart == Some(Restart::BootLoader) {
            return Indication::default();
        }
        Indication {
            colour: match self.is_forgotten(now) {
                true if now.as_micros() % FLASH_PERIOD_US < FLASH_US => Colour::Red,
                true => Colour::Off,
                false => self.colour(),
            },
            tone: if self.sounds(now) {
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
        } else if self.battery_alert == BatteryAlert::Charging {
            Colour::White
        } else {
            Colour::Green
        }
    }

    fn sounds(&self, now: Instant) -> bool {
        let was_refused = |at| now.us_since(at) < REFUSED_TONE_US;
        if self.refused_at.is_some_and(was_refused) {
            true
        } else if self.is_forgotten(now) {
            sounds_three_tones(now, FORGOTTEN_PERIOD_US)
        } else if self.is_urgent() {
            sounds_three_tones(now, URGENT_PERIOD_US)
        } else {
            self.is_warning() && now.as_micros() % WARNING_PERIOD_US < SHORT_TONE_US
        }
    }

    /// Whether a pack is drained below its critical threshold, without a station or a stick for long.
    fn is_forgotten(&self, now: Instant) -> bool {
        !self.below_critical.is_empty() && now.us_since(self.attended_at) >= FORGOTTEN_AFTER_US
    }

    fn is_urgent(&self) -> bool {
        self.is_terminated() || self.battery_alert == BatteryAlert::Urgent
    }

    fn is_warning(&self) -> bool {
        self.battery_alert == BatteryAlert::Warning || self.has_timed_out()
    }

    /// Status for ground stations.
    pub fn status(&self) -> VehicleStatus {
        VehicleStatus {
            mode: self.mode,
            arm_state: self.arm_state,
            fitness: self.fitness,
            alert: if self.is_terminated() {
                Alert::Terminated
            } else if self.has_timed_out() {
                Alert::TimedOut
            } else {
                Alert::None
            },
        }
    }

    /// Whether it is armed.
    pub fn arm_state(&self) -> ArmState {
        self.arm_state
    }

    /// Number of armings (wraps): it shows a task for a disarmed rover that this one was armed meanwhile.
    pub fn armings(&self) -> u8 {
        self.armings
    }

    /// Whether a failsafe has terminated the drive: disarmed until a restart or a battery reset.
    pub fn is_terminated(&self) -> bool {
        !self.terminated_by.is_empty()
    }

    /// Whether the failsafe of this pack has.
    pub fn is_terminated_by(&self, pack: Pack) -> bool {
        self.terminated_by.contains(pack)
    }

    /// The program after a pending restart.
    pub fn pending_restart(&self) -> Option<Restart> {
        self.pending_restart
    }

    fn is_driving(&self) -> bool {
        self.arm_state == ArmState::Armed && self.mode == Mode::Manual
    }

    /// Whether control inputs or ground stations have timed out and not resumed.
    fn has_timed_out(&self) -> bool {
        self.driver_lost || self.controls.have_timed_out() || self.ground_stations.has_timed_out()
    }
}

/// Whether one of three short tones at the beginning of each period sounds now.
fn sounds_three_tones(now: Instant, period_us: u64) -> bool {
    let slot = now.as_micros() % period_us / SHORT_TONE_US;
    slot.is_multiple_of(2) && slot < 2 * URGENT_TONES
}

#[cfg(test)]
mod tests;
