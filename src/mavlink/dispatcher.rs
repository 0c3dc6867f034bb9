//! Gives what was received to the service it is for.

use ::mavlink::MessageData;

use super::COMPONENT_ID;
use super::command_ack::CommandAck;
use super::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, PARAM_REQUEST_LIST_DATA,
    PARAM_REQUEST_READ_DATA, PARAM_SET_DATA,
};
use super::file_transfer::FileTransferNak;
use super::message::Message;
use super::parser::ReceivedFrame;
use super::payload::Payload;
use super::services::commands::{Action, Command};
use super::services::parameters::{self, ParameterList, SetResult};
use crate::parameter::{ParameterId, Parameters};

/// Who sent a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Its system id.
    pub system_id: u8,
    /// Its component id.
    pub component_id: u8,
}

/// What came of a received message, for whoever runs the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
}

/// What the frame asks for if it is for us: system and component 0 mean everyone.
fn request(frame: &ReceivedFrame<'_>, system_id: u8) -> Option<Request> {
    let (request, target_at) = match frame.message_id {
        PARAM_REQUEST_LIST_DATA::ID => (Request::ParameterList, 0),
        PARAM_REQUEST_READ_DATA::ID => (Request::ParameterRead, 2),
        PARAM_SET_DATA::ID => (Request::ParameterSet, 4),
        COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => (Request::Command, 30),
        FILE_TRANSFER_PROTOCOL_DATA::ID => (Request::FileTransfer, 1),
        _ => return None,
    };
    let target_system = frame.payload.u8(target_at);
    let target_component = frame.payload.u8(target_at + 1);
    let ours = [0, system_id].contains(&target_system) && [0, COMPONENT_ID].contains(&target_component);
    ours.then_some(request)
}

/// Handles one frame: answers through `answer`, starts a list in `list`, sets in `parameters`.
pub(super) fn dispatch(
    frame: &ReceivedFrame<'_>,
    now_us: u64,
    parameters: &mut Parameters,
    list: &mut ParameterList,
    mut answer: impl FnMut(Message),
) -> Event {
    // The table's range is 1 to 255.
    let system_id = parameters.get(ParameterId::SysidThismav) as u8;
    let Some(request) = request(frame, system_id) else {
        return Event::Ignored;
    };
    let from = Peer {
        system_id: frame.system_id,
        component_id: frame.component_id,
    };
    match request {
        Request::ParameterList => {
            list.start(now_us);
            Event::ListRequested
        }
        Request::ParameterRead => {
            answer(parameters::read(&frame.payload, from, parameters));
            Event::Answered
        }
        Request::ParameterSet => match parameters::set(&frame.payload, from, parameters, answer) {
            SetResult::Set(id) => Event::ParameterSet(id),
            SetResult::Refused => Event::ParameterRefused,
        },
        Request::Command => command(&frame.payload, from, answer),
        Request::FileTransfer => {
            let nak = FileTransferNak::refuse(&frame.payload, from.system_id, from.component_id);
            if let Some(nak) = nak {
                answer(Message::FileTransferNak(nak));
            }
            Event::Answered
        }
    }
}

fn command(payload: &Payload<'_>, from: Peer, mut answer: impl FnMut(Message)) -> Event {
    let command = Command::read(payload);
    let (result, action) = command.execute();
    answer(Message::CommandAck(CommandAck {
        command: command.number,
        result,
        target_system: from.system_id,
        target_component: from.component_id,
    }));
    match action {
        Some(action) => Event::Command(action),
        None => Event::CommandRefused(command.number),
    }
}
