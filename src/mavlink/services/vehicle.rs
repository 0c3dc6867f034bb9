//! Arming, modes, control inputs and the heartbeats of ground stations.

use ::mavlink::MessageData;
use heapless::String;

use super::{Context, LateSticksTexts, TOO_LATE};
use crate::announce::{Announce, Severity};
use crate::mavlink::Peer;
use crate::mavlink::dialect::{MavCmd, MavModeFlag, MavResult, SET_MODE_DATA};
use crate::mavlink::event::Event;
use crate::mavlink::outbox::Outbox;
use crate::mavlink::requests::{Command, Request};
use crate::mavlink::signing::Authenticity;
use crate::numbers::text;
use crate::parameter::Parameters;
use crate::system::{SystemState, arming_obstacles};
use crate::time::Instant;
use crate::vehicle::{
    AnotherDrives, ArmState, ControlMessage, DriverId, Fitness, Mode, Presence, Stick, StickInput, Vehicle,
    control_timeout_us,
};

const ARM_DISARM: u16 = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM as u16;
const RUN_PREARM_CHECKS: u16 = MavCmd::MAV_CMD_RUN_PREARM_CHECKS as u16;
const DO_SET_MODE: u16 = MavCmd::MAV_CMD_DO_SET_MODE as u16;

/// MAV_CMD_COMPONENT_ARM_DISARM, parameter 1.
const DISARM: f32 = 0.0;
const ARM: f32 = 1.0;

/// Parameter 2: arm without any check. MAVLink's number for it, and the one ArduPilot's ground stations send.
const FORCE: [f32; 2] = [21196.0, 2989.0];

/// The oldest request of the page that may set the rover in motion, in milliseconds. A figure of its own: `FS_TIMEOUT` may be
/// 100 s.
const MAX_AGE_MS: u32 = 1_500;

/// Why the sticks of a station are ignored.
const ANOTHER_STATION: &str = "Sticks ignored: another station drives";
const ANOTHER_MESSAGE: &str = "Sticks ignored: this station drives by another message";
const STICKS_TOO_LATE: &str = "Sticks ignored: too late";

const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;
const DENIED: MavResult = MavResult::MAV_RESULT_DENIED;

/// Whether all that a request can do is stop the rover, and it is obeyed for that. Neutral sticks of an overtaken frame are not:
/// repeated, they open a gate and hold off a failsafe.
pub fn may_stop(request: &Request<'_>, authenticity: Authenticity, vehicle: &Vehicle) -> bool {
    let (may_disarm, may_hold, is_late) = match authenticity {
        Authenticity::Late => (true, true, true),
        Authenticity::Overtaken { may_disarm, may_hold } => (may_disarm, may_hold, false),
        _ => return false,
    };
    let hold = Mode::Hold.number();
    let (throttle, steering) = match request {
        Request::Command(Command {
            number: ARM_DISARM,
            param1,
            ..
        }) => return may_disarm && *param1 == DISARM,
        Request::Command(Command {
            number: DO_SET_MODE,
            param2,
            ..
        }) => return may_hold && *param2 == hold as f32,
        Request::SetMode { custom_mode, .. } => return may_hold && *custom_mode == hold,
        Request::Control { throttle, steering } => (*throttle, *steering),
        Request::ChannelOverride(pulses_us) => vehicle.stick_inputs(pulses_us),
        _ => return false,
    };
    is_late && throttle.is_neutral() && steering.is_neutral()
}

/// Handles one request for the vehicle: executes it, or refuses it and says why.
pub struct VehicleService<'a> {
    pub now: Instant,
    /// The request can't have been received earlier.
    pub received_at: Instant,
    /// Upper bound of its age by its sender's clock, in milliseconds, if it is known.
    pub age_ms: Option<u32>,
    /// Presence of a ground station by the request.
    pub presence: Presence,
    /// The number of the link that it came by.
    pub link_number: u16,
    /// Decides, with the parameters, whether the rover is fit to be armed.
    pub state: &'a SystemState<'a>,
    pub parameters: &'a Parameters,
    pub vehicle: &'a mut Vehicle,
    pub outbox: &'a mut Outbox,
    pub late_sticks_texts: &'a mut LateSticksTexts,
}

impl<'a> VehicleService<'a> {
    pub fn of(context: &'a mut Context<'_>) -> Self {
        Self {
            now: context.now,
            received_at: context.received_at,
            age_ms: context.age_ms,
            presence: context.presence,
            link_number: context.link_number,
            state: context.state,
            parameters: context.changeable.parameters,
            vehicle: context.changeable.vehicle,
            outbox: context.outbox,
            late_sticks_texts: context.late_sticks_texts,
        }
    }

    /// Whether commands of this number are for the vehicle.
    pub fn knows(number: u16) -> bool {
        [ARM_DISARM, RUN_PREARM_CHECKS, DO_SET_MODE].contains(&number)
    }

    /// Whether commands of this number change the vehicle.
    pub fn changes_by(number: u16) -> bool {
        [ARM_DISARM, DO_SET_MODE].contains(&number)
    }

    /// Does what a command asks of the rover, says why if it can't, and acknowledges it.
    pub fn execute(&mut self, command: &Command, from: Peer) -> Event {
        let result = self.result_of(command);
        self.acknowledge(command.number, result, from)
    }

    fn result_of(&mut self, command: &Command) -> MavResult {
        match command.number {
            ARM_DISARM if command.param1 == ARM && self.is_late() => self.refuse_late(),
            ARM_DISARM if command.param1 == ARM => self.arm(FORCE.contains(&command.param2)),
            ARM_DISARM if command.param1 == DISARM => {
                // A recording must not take the seat from a driver who has come since.
                if self.vehicle.arm_state() == ArmState::Armed {
                    self.vehicle.disarm();
                }
                ACCEPTED
            }
            RUN_PREARM_CHECKS => self.check(),
            DO_SET_MODE => {
                let base_mode = whole_number(command.param1).and_then(|number| u8::try_from(number).ok());
                match (base_mode, whole_number(command.param2)) {
                    (Some(base_mode), Some(mode)) => self.set_mode(base_mode, mode),
                    _ => DENIED,
                }
            }
            _ => DENIED,
        }
    }

    /// Whether the request may have waited too long to move the rover, on its way or here.
    fn is_late(&self) -> bool {
        self.age_ms.is_some_and(|age_ms| age_ms > MAX_AGE_MS) || self.has_waited()
    }

    /// Whether the request may have waited here for too long to move the rover.
    fn has_waited(&self) -> bool {
        self.now.us_since(self.received_at) > control_timeout_us(self.parameters)
    }

    fn arm(&mut self, forced: bool) -> MavResult {
        if self.vehicle.arm_state() == ArmState::Armed {
            return ACCEPTED;
        }
        let obstacles = arming_obstacles(self.state, self.parameters, self.vehicle);
        let obstacle = obstacles.first();
        let fitness = match obstacle {
            _ if forced => Fitness::Forced,
            Some(_) => Fitness::Unfit,
            None => Fitness::Checked,
        };
        if self.vehicle.arm(self.now, fitness).is_ok() {
            return ACCEPTED;
        }
        if let Some(obstacle) = obstacle {
            self.outbox.refuse_arming(*obstacle);
        }
        FAILED
    }

    /// Reports everything that keeps the rover from being armed, and parameters that a restart would lose.
    fn check(&mut self) -> MavResult {
        if self.vehicle.arm_state() == ArmState::Armed {
            return MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
        }
        for obstacle in arming_obstacles(self.state, self.parameters, self.vehicle) {
            let text = obstacle.text("PreArm");
            self.outbox.explain(Severity::Critical, &text);
        }
        if let Some(failure) = self.parameters.save_failure() {
            let text: String<64> = text(format_args!("PreArm: {failure}"));
            self.outbox.explain(failure.severity(), &text);
        }
        ACCEPTED
    }

    /// SET_MODE: as in ArduPilot, it is acknowledged like a command of its own number.
    pub fn set_mode_by_message(&mut self, base_mode: u8, number: u32, from: Peer) -> Event {
        let result = self.set_mode(base_mode, number);
        self.acknowledge(SET_MODE_DATA::ID as u16, result, from)
    }

    /// As in ArduPilot, a mode without the flag for ArduPilot's own modes is denied and one that is not known fails.
    fn set_mode(&mut self, base_mode: u8, number: u32) -> MavResult {
        if base_mode & MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED.bits() == 0 {
            return DENIED;
        }
        let Some(mode) = Mode::from_number(number) else {
            let [first, second] = Mode::ALL.map(Mode::name);
            // The longest number fits.
            let text: String<48> = text(format_args!("No such mode {number}: {first} or {second}"));
            self.outbox.explain(Severity::Warning, &text);
            return FAILED;
        };
        if mode != Mode::Hold && self.is_late() {
            return self.refuse_late();
        }
        match self.vehicle.set_mode(mode) {
            Ok(()) => ACCEPTED,
            Err(_) => {
                let text = "Failsafe active: mode change denied";
                self.outbox.explain(Severity::Warning, text);
                FAILED
            }
        }
    }

    /// RC_CHANNELS_OVERRIDE.
    pub fn control_by_channels(&mut self, pulses_us: &[u16], from: Peer) -> Event {
        let (throttle, steering) = self.vehicle.stick_inputs(pulses_us);
        self.control(throttle, steering, ControlMessage::ChannelOverride, from)
    }

    /// The sticks of MANUAL_CONTROL or RC_CHANNELS_OVERRIDE. Neutral ones stop the rover, however long they were on their way.
    pub fn control(
        &mut self,
        throttle: StickInput,
        steering: StickInput,
        message: ControlMessage,
        from: Peer,
    ) -> Event {
        if self.has_waited() {
            return Event::ControlTooLate;
        }
        let is_deflected = throttle.is_deflected() || steering.is_deflected();
        if is_deflected && self.is_late() {
            if self.late_sticks_texts.take(self.now) {
                self.outbox.explain(Severity::Warning, STICKS_TOO_LATE);
            }
            return Event::ControlTooLate;
        }
        let from = DriverId {
            link: self.link_number,
            system_id: from.system_id,
            component_id: from.component_id,
            message,
        };
        let (at, presence) = (self.received_at, self.presence);
        let result = self.vehicle.control(from, at, presence, throttle, steering);
        self.driven(from, result)
    }

    /// Result of a control message, and a text for its sender if a stick has no effect.
    fn driven(&mut self, from: DriverId, result: Result<Option<Stick>, AnotherDrives>) -> Event {
        match result {
            Ok(None) => Event::Driven,
            Ok(Some(stick)) => {
                let name = match stick {
                    Stick::Throttle => "throttle",
                    Stick::Steering => "steering",
                };
                let number = self.vehicle.channel_number(stick);
                // The longest number fits.
                let text: String<40> = text(format_args!("Centre the {name} (RC{number}) first"));
                self.outbox.explain(Severity::Warning, &text);
                Event::Driven
            }
            Err(AnotherDrives { report }) => {
                if let Some(driver) = report {
                    let message = from.message;
                    let reason = if (DriverId { message, ..driver }) == from {
                        ANOTHER_MESSAGE
                    } else {
                        ANOTHER_STATION
                    };
                    self.outbox.explain(Severity::Warning, reason);
                }
                Event::Answered
            }
        }
    }

    fn acknowledge(&mut self, command: u16, result: MavResult, from: Peer) -> Event {
        self.outbox.acknowledge(command, result, from);
        match result {
            ACCEPTED if command == RUN_PREARM_CHECKS => Event::Answered,
            ACCEPTED => Event::Driven,
            _ => Event::CommandRefused(command),
        }
    }

    fn refuse_late(&mut self) -> MavResult {
        self.outbox.explain(Severity::Warning, TOO_LATE);
        FAILED
    }
}

fn whole_number(parameter: f32) -> Option<u32> {
    let number = parameter as u32;
    (number as f32 == parameter).then_some(number)
}
