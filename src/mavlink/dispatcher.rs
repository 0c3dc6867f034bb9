//! Gives what was received to the service it is for.

use ::mavlink::MessageData;

use super::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, MavResult, PARAM_REQUEST_LIST_DATA,
    PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PING_DATA, RADIO_STATUS_DATA, REQUEST_DATA_STREAM_DATA,
    TIMESYNC_DATA,
};
use super::parser::ReceivedFrame;
use super::rates::Rates;
use super::services::commands::{Action, Command};
use super::services::parameters::{self, ParameterList, SetResult};
use super::services::time;
use super::system_state::SystemState;
use super::{COMPONENT_ID, CommandAck, FileTransferNak, Message};
use crate::parameter::{ParameterId, Parameters, VehicleParameter};

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
    /// It was not for us, or nothing we act on.
    Ignored,
    /// It was answered.
    Answered,
    /// A ground station reads all parameters.
    ListRequested,
    /// A parameter was set by a ground station.
    ParameterSet(ParameterId),
    /// A ground station tried to set a parameter and was refused.
    ParameterRefused,
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
}

/// What the frame asks for if it is for us: system and component 0 mean everyone.
fn request(frame: &ReceivedFrame<'_>, system_id: u8) -> Option<Request> {
    let (request, target_at) = match frame.message_id {
        PARAM_REQUEST_LIST_DATA::ID => (Request::ParameterList, Some(0)),
        PARAM_REQUEST_READ_DATA::ID => (Request::ParameterRead, Some(2)),
        PARAM_SET_DATA::ID => (Request::ParameterSet, Some(4)),
        COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => (Request::Command, Some(30)),
        FILE_TRANSFER_PROTOCOL_DATA::ID => (Request::FileTransfer, Some(1)),
        REQUEST_DATA_STREAM_DATA::ID => (Request::DataStream, Some(2)),
        PING_DATA::ID => (Request::Ping, Some(12)),
        TIMESYNC_DATA::ID => (Request::Timesync, Some(16)),
        RADIO_STATUS_DATA::ID => (Request::RadioStatus, None),
        _ => return None,
    };
    // A message without a target is for everyone.
    let ours = target_at.is_none_or(|at| {
        let (system, component) = (frame.payload.u8(at), frame.payload.u8(at + 1));
        [0, system_id].contains(&system) && [0, COMPONENT_ID].contains(&component)
    });
    ours.then_some(request)
}

/// What a request may use and change.
pub(super) struct Context<'a> {
    pub now_us: u64,
    pub state: &'a SystemState<'a>,
    pub parameters: &'a mut Parameters,
    pub list: &'a mut ParameterList,
    pub rates: &'a mut Rates,
}

/// Handles one frame and answers through `answer`.
pub(super) fn dispatch(
    frame: &ReceivedFrame<'_>,
    context: Context<'_>,
    mut answer: impl FnMut(Message),
) -> Event {
    let Context {
        now_us,
        state,
        parameters,
        list,
        rates,
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
    match request {
        Request::ParameterList => {
            list.start(now_us);
            return Event::ListRequested;
        }
        Request::ParameterRead => answer(parameters::read(payload, from, parameters)),
        Request::ParameterSet => {
            return match parameters::set(payload, from, parameters, answer) {
                SetResult::Set(id) => {
                    rates.parameter_set(id);
                    Event::ParameterSet(id)
                }
                SetResult::Refused => Event::ParameterRefused,
            };
        }
        Request::Command => {
            let command = Command::read(payload);
            let outcome = command.execute(&mut rates.scheduler, state, now_us);
            answer(Message::CommandAck(CommandAck {
                command: command.number,
                result: outcome.result,
                target_system: from.system_id,
                target_component: from.component_id,
            }));
            outcome.message.into_iter().for_each(answer);
            return match outcome.action {
                // Even a command that fails for one pack has an effect on the others.
                Some(action) => Event::Command(action),
                None if outcome.result == MavResult::MAV_RESULT_ACCEPTED => Event::Answered,
                None => Event::CommandRefused(command.number),
            };
        }
        Request::FileTransfer => {
            let nak = FileTransferNak::refuse(payload, from.system_id, from.component_id);
            nak.map(Message::FileTransferNak).into_iter().for_each(answer);
        }
        Request::DataStream => rates.request_data_stream(payload),
        Request::Ping => time::ping(payload, from).into_iter().for_each(answer),
        Request::Timesync => time::timesync(payload, from, now_us).into_iter().for_each(answer),
        Request::RadioStatus => rates.radio_status(payload, now_us),
    }
    Event::Answered
}
