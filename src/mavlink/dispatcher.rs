//! Gives what was received to the service it is for.

use ::mavlink::MessageData;

use super::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA, MANUAL_CONTROL_DATA,
    MavResult, MavSeverity, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PING_DATA,
    RADIO_STATUS_DATA, RC_CHANNELS_OVERRIDE_DATA, REQUEST_DATA_STREAM_DATA, SET_MODE_DATA,
    SETUP_SIGNING_DATA, TIMESYNC_DATA,
};
use super::parser::ReceivedFrame;
use super::payload::Payload;
use super::rates::{Rates, is_radio};
use super::replies::Replies;
use super::services::commands::{Action, Command};
use super::services::parameters::{self, ParameterList, SetResult};
use super::services::signing::{self, SetupRefused, SigningChange};
use super::services::time;
use super::services::vehicle::{Driving, Rover, is_of_ground_station};
use super::signing::{AcceptUnsigned, Effect, LinkKind, Signing, is_permitted};
use super::system_state::SystemState;
use super::{COMPONENT_ID, FileTransferNak, Message};
use crate::battery::ArmState;
use crate::parameter::{ParameterId, Parameters, VehicleParameter};
use crate::vehicle::Vehicle;

/// Why a restart or a reset of the parameters is refused.
const DISARM_FIRST: &str = "Not while armed: disarm first";

/// Who sent a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Its system id.
    pub system_id: u8,
    /// Its component id.
    pub component_id: u8,
}

/// What came of a received message, for whoever runs the link.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Event {
    /// It was not for us, or nothing to act on at once.
    Ignored,
    /// A ground station gave a sign of life.
    GroundStationHeard,
    /// It was answered.
    Answered,
    /// A ground station reads all parameters.
    ListRequested,
    /// A parameter was set by a ground station.
    ParameterSet(ParameterId),
    /// A ground station tried to set a parameter and was refused.
    ParameterRefused,
    /// The rover was armed or disarmed, its mode was set, or its driver moved a lever.
    Driven,
    /// A command, by its number, has this effect.
    Command(Action),
    /// A command of this number is not supported, or not with its parameters.
    CommandRefused(u16),
    /// A control message may have waited for longer than `FS_TIMEOUT`, and had no effect.
    ControlTooLate,
    /// Another signing key, or none any more.
    SigningSetUp(SigningChange),
    /// Signing was not set up.
    SigningRefused(SetupRefused),
    /// It was not signed as it would have to be, and had no effect.
    Unauthorized {
        /// How many there have been on this link, if everyone should be told now.
        to_report: Option<u32>,
    },
}

/// A request that concerns us.
enum Request {
    ParameterList,
    ParameterRead,
    ParameterSet,
    Command,
    FileTransfer,
    DataStream,
    Ping,
    Timesync,
    RadioStatus,
    SetMode,
    ManualControl,
    OverrideChannels,
    Heartbeat,
    SetUpSigning,
}

impl Request {
    /// What it does, at most.
    fn effect(&self, payload: &Payload<'_>) -> Effect {
        match self {
            Self::RadioStatus => Effect::RadioReport,
            Self::ParameterList | Self::ParameterRead | Self::FileTransfer | Self::Ping | Self::Timesync => {
                Effect::Reads
            }
            Self::Command if Command::read(payload).only_reads() => Effect::Reads,
            Self::Command
            | Self::ParameterSet
            | Self::DataStream
            | Self::SetMode
            | Self::ManualControl
            | Self::OverrideChannels
            | Self::Heartbeat
            | Self::SetUpSigning => Effect::Changes,
        }
    }
}

/// Whom a message is for, by the places of its fields.
enum Target {
    /// Everyone.
    None,
    /// The system whose id is there, 0 meaning everyone.
    System(usize),
    /// The system whose id is there and no other: levers are of one rover.
    OnlySystem(usize),
    /// The same for the system's id there and the component's behind it.
    Component(usize),
    /// The system whose id is there and no other, and the component whose id is behind it, 0 meaning all of that system.
    OnlyComponent(usize),
}

impl Target {
    fn is_ours(&self, payload: &Payload<'_>, system_id: u8) -> bool {
        let is_our_system = |at| [0, system_id].contains(&payload.u8(at));
        let is_our_component = |at| [0, COMPONENT_ID].contains(&payload.u8(at));
        match *self {
            Self::None => true,
            Self::System(at) => is_our_system(at),
            Self::OnlySystem(at) => payload.u8(at) == system_id,
            Self::Component(at) => is_our_system(at) && is_our_component(at + 1),
            Self::OnlyComponent(at) => payload.u8(at) == system_id && is_our_component(at + 1),
        }
    }
}

/// What the frame asks for if it is for us.
fn request(frame: &ReceivedFrame<'_>, system_id: u8) -> Option<Request> {
    let (request, target) = match frame.message_id {
        PARAM_REQUEST_LIST_DATA::ID => (Request::ParameterList, Target::Component(0)),
        PARAM_REQUEST_READ_DATA::ID => (Request::ParameterRead, Target::Component(2)),
        PARAM_SET_DATA::ID => (Request::ParameterSet, Target::Component(4)),
        COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => (Request::Command, Target::Component(30)),
        FILE_TRANSFER_PROTOCOL_DATA::ID => (Request::FileTransfer, Target::Component(1)),
        REQUEST_DATA_STREAM_DATA::ID => (Request::DataStream, Target::Component(2)),
        PING_DATA::ID => (Request::Ping, Target::Component(12)),
        TIMESYNC_DATA::ID => (Request::Timesync, Target::Component(16)),
        RADIO_STATUS_DATA::ID => (Request::RadioStatus, Target::None),
        SET_MODE_DATA::ID => (Request::SetMode, Target::System(4)),
        MANUAL_CONTROL_DATA::ID => (Request::ManualControl, Target::OnlySystem(10)),
        RC_CHANNELS_OVERRIDE_DATA::ID => (Request::OverrideChannels, Target::OnlyComponent(16)),
        HEARTBEAT_DATA::ID => (Request::Heartbeat, Target::None),
        SETUP_SIGNING_DATA::ID => (Request::SetUpSigning, Target::OnlySystem(8)),
        _ => return None,
    };
    target.is_ours(&frame.payload, system_id).then_some(request)
}

/// What a request may use and change.
pub(super) struct Context<'a> {
    pub now_us: u64,
    /// The frame can't have been received earlier.
    pub received_us: u64,
    pub state: &'a SystemState<'a>,
    pub parameters: &'a mut Parameters,
    pub list: &'a mut ParameterList,
    pub rates: &'a mut Rates,
    pub vehicle: &'a mut Vehicle,
    pub link: LinkKind,
    pub signing: &'a mut Signing,
    /// Messages on this link that were not signed as they would have to be.
    pub unauthorized: &'a mut u32,
}

impl Context<'_> {
    /// Whether whoever sent `frame` may do what it asks for.
    fn permits(&mut self, request: &Request, frame: &ReceivedFrame<'_>) -> bool {
        let accepted = AcceptUnsigned::on(self.link, self.parameters);
        let authenticity = self.signing.check(frame, self.now_us);
        // Without this, a lost key could never be replaced where `SIGN_USB_ALLOW` wants everything signed with it.
        let replaces_lost_key = matches!(request, Request::SetUpSigning)
            && self.link == LinkKind::Direct
            && self.signing.has_lost_key();
        replaces_lost_key || is_permitted(request.effect(&frame.payload), authenticity, accepted)
    }

    /// Counts a request that is not permitted.
    fn refuse(&mut self, request: &Request) -> Event {
        // Every vehicle and ground station around has a heartbeat, and no key of ours.
        if matches!(request, Request::Heartbeat) {
            return Event::Ignored;
        }
        *self.unauthorized = self.unauthorized.wrapping_add(1);
        Event::Unauthorized {
            to_report: self.signing.may_report(self.now_us).then_some(*self.unauthorized),
        }
    }
}

/// Handles one frame and answers through `replies`.
pub(super) fn dispatch(frame: &ReceivedFrame<'_>, mut context: Context<'_>, replies: Replies<'_>) -> Event {
    // The table's range is 1 to 255.
    let system_id = context.parameters.get(VehicleParameter::SysidThismav) as u8;
    match request(frame, system_id) {
        None => Event::Ignored,
        Some(request) if context.permits(&request, frame) => serve(request, frame, context, replies),
        Some(request) => context.refuse(&request),
    }
}

/// Does what a frame asks for.
fn serve(
    request: Request,
    frame: &ReceivedFrame<'_>,
    context: Context<'_>,
    mut replies: Replies<'_>,
) -> Event {
    let Context {
        now_us,
        received_us,
        state,
        parameters,
        list,
        rates,
        vehicle,
        link,
        signing,
        unauthorized: _,
    } = context;
    let from = Peer {
        system_id: frame.system_id,
        component_id: frame.component_id,
    };
    let payload = &frame.payload;
    let mut rover = Rover {
        now_us,
        received_us,
        state,
        parameters,
        vehicle,
    };
    match request {
        Request::ParameterList => {
            list.start(now_us);
            return Event::ListRequested;
        }
        Request::ParameterRead => replies.answer(parameters::read(payload, from, parameters)),
        Request::ParameterSet => {
            return match parameters::set(payload, from, parameters, |message| replies.answer(message)) {
                SetResult::Set(id) => {
                    rates.parameter_set(id);
                    Event::ParameterSet(id)
                }
                SetResult::Refused => Event::ParameterRefused,
            };
        }
        Request::Command => return command(payload, from, rover, rates, replies),
        Request::FileTransfer => {
            let nak = FileTransferNak::refuse(payload, from.system_id, from.component_id);
            replies.answer_any(nak.map(Message::FileTransferNak));
        }
        Request::DataStream => rates.request_data_stream(payload),
        Request::Ping => replies.answer_any(time::ping(payload, from)),
        Request::Timesync => replies.answer_any(time::timesync(payload, from, now_us)),
        Request::RadioStatus if is_radio(from.component_id, link) => rates.radio_status(payload, now_us),
        Request::RadioStatus => return Event::Ignored,
        Request::SetMode => {
            let result = rover.set_mode_by_message(payload, &mut replies);
            // As in ArduPilot, the message is acknowledged like a command of its own number.
            let number = SET_MODE_DATA::ID as u16;
            replies.acknowledge(number, result, from);
            return driven(number, result);
        }
        Request::ManualControl => return controlled(rover.manual_control(payload)),
        Request::OverrideChannels => return controlled(rover.override_channels(payload)),
        Request::Heartbeat => {
            if !is_of_ground_station(payload) {
                return Event::Ignored;
            }
            rover.ground_station_seen();
            return Event::GroundStationHeard;
        }
        Request::SetUpSigning => return set_up_signing(payload, link, signing, now_us, replies),
    }
    Event::Answered
}

/// Handles COMMAND_LONG and COMMAND_INT: a few are for the rover, the others for the link or the board.
fn command(
    payload: &Payload<'_>,
    from: Peer,
    mut rover: Rover<'_>,
    rates: &mut Rates,
    mut replies: Replies<'_>,
) -> Event {
    let command = Command::read(payload);
    if Rover::knows(command.number) {
        let result = rover.execute(&command, &mut replies);
        replies.acknowledge(command.number, result, from);
        return driven(command.number, result);
    }
    let outcome = command.execute(&mut rates.scheduler, rover.state, rover.now_us);
    if outcome.action.is_some_and(Action::needs_disarmed) && rover.vehicle.arm_state() == ArmState::Armed {
        replies.explain(MavSeverity::MAV_SEVERITY_WARNING, DISARM_FIRST);
        replies.acknowledge(command.number, MavResult::MAV_RESULT_FAILED, from);
        return Event::CommandRefused(command.number);
    }
    if outcome.action == Some(Action::Reboot) {
        rover.vehicle.prepare_restart();
    }
    replies.acknowledge(command.number, outcome.result, from);
    replies.answer_any(outcome.message);
    match outcome.action {
        // Even a command that fails for one pack has an effect on the others.
        Some(action) => Event::Command(action),
        None if outcome.result == MavResult::MAV_RESULT_ACCEPTED => Event::Answered,
        None => Event::CommandRefused(command.number),
    }
}

/// Sets up signing. There is no acknowledgement in MAVLink, so a text says what came of it.
fn set_up_signing(
    payload: &Payload<'_>,
    link: LinkKind,
    signing: &mut Signing,
    now_us: u64,
    mut replies: Replies<'_>,
) -> Event {
    match signing::set_up(payload, link, signing, now_us) {
        Ok(change) => Event::SigningSetUp(change),
        Err(refused) => {
            replies.say(MavSeverity::MAV_SEVERITY_WARNING, refused.text());
            Event::SigningRefused(refused)
        }
    }
}

/// What came of a control message.
fn controlled(driving: Driving) -> Event {
    match driving {
        Driving::Obeyed => Event::Driven,
        Driving::TooLate => Event::ControlTooLate,
    }
}

/// What came of a command to the rover.
fn driven(command: u16, result: MavResult) -> Event {
    match result {
        MavResult::MAV_RESULT_ACCEPTED => Event::Driven,
        _ => Event::CommandRefused(command),
    }
}
