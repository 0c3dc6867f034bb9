//! Gives what was received to the service it is for.

use ::mavlink::MessageData;

use super::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA, MANUAL_CONTROL_DATA,
    MavResult, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PING_DATA,
    RADIO_STATUS_DATA, RC_CHANNELS_OVERRIDE_DATA, REQUEST_DATA_STREAM_DATA, SET_MODE_DATA, TIMESYNC_DATA,
};
use super::parser::ReceivedFrame;
use super::payload::Payload;
use super::rates::Rates;
use super::replies::Replies;
use super::services::commands::{Action, Command};
use super::services::parameters::{self, ParameterList, SetResult};
use super::services::time;
use super::services::vehicle::{Rover, is_of_ground_station};
use super::system_state::SystemState;
use super::{COMPONENT_ID, FileTransferNak, Message};
use crate::parameter::{ParameterId, Parameters, VehicleParameter};
use crate::vehicle::Vehicle;

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
}

impl Target {
    fn is_ours(&self, payload: &Payload<'_>, system_id: u8) -> bool {
        let is_our_system = |at| [0, system_id].contains(&payload.u8(at));
        match *self {
            Self::None => true,
            Self::System(at) => is_our_system(at),
            Self::OnlySystem(at) => payload.u8(at) == system_id,
            Self::Component(at) => is_our_system(at) && [0, COMPONENT_ID].contains(&payload.u8(at + 1)),
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
        RC_CHANNELS_OVERRIDE_DATA::ID => (Request::OverrideChannels, Target::Component(16)),
        HEARTBEAT_DATA::ID => (Request::Heartbeat, Target::None),
        _ => return None,
    };
    target.is_ours(&frame.payload, system_id).then_some(request)
}

/// What a request may use and change.
pub(super) struct Context<'a> {
    pub now_us: u64,
    pub state: &'a SystemState<'a>,
    pub parameters: &'a mut Parameters,
    pub list: &'a mut ParameterList,
    pub rates: &'a mut Rates,
    pub vehicle: &'a mut Vehicle,
}

/// Handles one frame and answers through `replies`.
pub(super) fn dispatch(frame: &ReceivedFrame<'_>, context: Context<'_>, mut replies: Replies<'_>) -> Event {
    let Context {
        now_us,
        state,
        parameters,
        list,
        rates,
        vehicle,
    } = context;
    // The table's range is 1 to 255.
    let system_id = parameters.get(VehicleParameter::SysidThismav) as u8;
    let Some(request) = request(frame, system_id) else {
        return Event::Ignored;
    };
    let from = Peer {
        system_id: frame.system_id,
        component_id: frame.component_id,
    };
    let payload = &frame.payload;
    let mut rover = Rover {
        now_us,
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
        Request::RadioStatus => rates.radio_status(payload, now_us),
        Request::SetMode => {
            let result = rover.set_mode_by_message(payload, &mut replies);
            // As in ArduPilot, the message is acknowledged like a command of its own number.
            let number = SET_MODE_DATA::ID as u16;
            replies.acknowledge(number, result, from);
            return driven(number, result);
        }
        Request::ManualControl => {
            rover.manual_control(payload);
            return Event::Driven;
        }
        Request::OverrideChannels => {
            rover.override_channels(payload);
            return Event::Driven;
        }
        Request::Heartbeat => {
            if !is_of_ground_station(payload) {
                return Event::Ignored;
            }
            rover.ground_station_seen();
            return Event::GroundStationHeard;
        }
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
    replies.acknowledge(command.number, outcome.result, from);
    replies.answer_any(outcome.message);
    match outcome.action {
        // Even a command that fails for one pack has an effect on the others.
        Some(action) => Event::Command(action),
        None if outcome.result == MavResult::MAV_RESULT_ACCEPTED => Event::Answered,
        None => Event::CommandRefused(command.number),
    }
}

/// What came of a command to the rover.
fn driven(command: u16, result: MavResult) -> Event {
    match result {
        MavResult::MAV_RESULT_ACCEPTED => Event::Driven,
        _ => Event::CommandRefused(command),
    }
}
