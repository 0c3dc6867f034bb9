//! Gives what was received to the service it is for.

use ::mavlink::MessageData;

use super::dialect::{MavResult, MavSeverity, WIFI_CONFIG_AP_DATA};
use super::event::{Action, Event};
use super::parser::ReceivedFrame;
use super::rates::{Rates, is_radio};
use super::replies::Replies;
use super::requests::{Command, Peer, ReceivedRequest, Request};
use super::services::commands::Answer;
use super::services::downloads::Downloads;
use super::services::file_transfer::{self, FileEvent};
use super::services::log_download::Refusal;
use super::services::parameters::{self, ParameterList};
use super::services::vehicle::{VehicleService, is_of_ground_station};
use super::services::{DISARM_FIRST, signing, time, wifi};
use super::signing::{AcceptUnsigned, Authenticity, Effect, LinkKind, Signing, is_permitted};
use super::stations::{Introduction, Stations};
use super::{COMPONENT_ID, Message};
use crate::parameter::{Parameters, VehicleParameter};
use crate::system::SystemState;
use crate::time::Instant;
use crate::vehicle::ArmState;
use crate::vehicle::Vehicle;
use crate::wifi::WifiCredentials;

/// What a request does, at most.
fn effect(request: &Request<'_>) -> Effect {
    match request {
        Request::FileTransfer(transfer) if file_transfer::writes(transfer.opcode) => Effect::Changes,
        Request::RadioStatus(_) => Effect::RadioReport,
        Request::ParameterList
        | Request::ParameterRead(_)
        | Request::FileTransfer(_)
        | Request::LogList(_)
        | Request::LogData(_)
        | Request::LogEnd
        | Request::Ping(_)
        | Request::Timesync(_) => Effect::Reads,
        Request::Command(command) if command.only_reads() => Effect::Reads,
        Request::Command(_)
        | Request::ParameterSet(_)
        | Request::DataStream(_)
        | Request::SetMode(_)
        | Request::Control(_)
        | Request::Heartbeat(_)
        | Request::SetUpSigning(_)
        | Request::LogErase
        | Request::WifiConfig(_)
        | Request::PackReading(_) => Effect::Changes,
    }
}

/// What requests may change, apart from their link.
#[derive(Debug)]
pub struct Changeable<'a> {
    /// The live parameters.
    pub parameters: &'a mut Parameters,
    /// The vehicle.
    pub vehicle: &'a mut Vehicle,
    /// The signing key.
    pub signing: &'a mut Signing,
    /// Names and passwords of Wi-Fi networks.
    pub wifi: &'a mut WifiCredentials,
}

/// What a request may use and change.
pub(super) struct Context<'a> {
    pub now: Instant,
    /// The frame can't have been received earlier.
    pub received_at: Instant,
    pub state: &'a SystemState<'a>,
    pub changeable: Changeable<'a>,
    pub list: &'a mut ParameterList,
    pub downloads: &'a mut Downloads,
    pub rates: &'a mut Rates,
    pub stations: &'a mut Stations,
    pub link: LinkKind,
    /// Messages on this link that were not signed as they would have to be.
    pub unauthorized: &'a mut u32,
}

impl Context<'_> {
    /// Whether the sender of `frame` may do what it asks for.
    fn permits(&mut self, request: &Request<'_>, frame: &ReceivedFrame<'_>) -> bool {
        let accepted = AcceptUnsigned::on(self.link, self.changeable.parameters);
        let signing = &mut *self.changeable.signing;
        let authenticity = signing.check(frame, self.now);
        // Without this, a lost key could never be replaced where `SIGN_USB_ALLOW` wants everything signed with it.
        let replaces_lost_key = matches!(request, Request::SetUpSigning(_))
            && self.link == LinkKind::Direct
            && signing.has_lost_key();
        // Over radio a password needs a signature, even without a key.
        let needs_proof = matches!(request, Request::WifiConfig(_)) && self.link != LinkKind::Direct;
        if needs_proof && authenticity != Authenticity::Proven {
            return false;
        }
        replaces_lost_key || is_permitted(effect(request), authenticity, accepted)
    }

    /// Counts a request that is not permitted.
    fn refuse(&mut self, request: &Request<'_>) -> Event {
        // Every vehicle and ground station around has a heartbeat, and no key of ours.
        if matches!(request, Request::Heartbeat(_)) {
            return Event::Ignored;
        }
        *self.unauthorized = self.unauthorized.wrapping_add(1);
        Event::Unauthorized {
            count: *self.unauthorized,
        }
    }
}

/// Handles one frame and answers through `replies`.
pub(super) fn dispatch(frame: &ReceivedFrame<'_>, mut context: Context<'_>, replies: Replies<'_>) -> Event {
    // The table's range is 1 to 255.
    let system_id = context.changeable.parameters.get(VehicleParameter::SysidThismav) as u8;
    let Some(received) = ReceivedRequest::decode(frame) else {
        return Event::Ignored;
    };
    if !received.target.is_ours(system_id) || !is_expected(&received, system_id, context.state.external_packs)
    {
        return Event::Ignored;
    }
    if context.permits(&received.request, frame) {
        serve(&received.request, received.from, context, replies)
    } else {
        context.refuse(&received.request)
    }
}

/// Whether a BATTERY_STATUS is of a pack that another component of this vehicle measures, and by one: other packs and
/// vehicles have theirs, which do not concern this one, signed or not.
fn is_expected(received: &ReceivedRequest<'_>, system_id: u8, external_packs: u16) -> bool {
    let Request::PackReading(reading) = &received.request else {
        return true;
    };
    received.from.system_id == system_id
        && received.from.component_id != COMPONENT_ID
        && external_packs & reading.pack.bit() != 0
}

/// Does what was asked for.
fn serve(request: &Request<'_>, from: Peer, context: Context<'_>, mut replies: Replies<'_>) -> Event {
    let Context {
        now,
        received_at,
        state,
        changeable,
        list,
        downloads,
        rates,
        stations,
        link,
        unauthorized: _,
    } = context;
    let Changeable {
        parameters,
        vehicle,
        signing,
        wifi: credentials,
    } = changeable;
    let mut service = VehicleService {
        now,
        received_at,
        state,
        parameters,
        vehicle,
    };
    match request {
        Request::ParameterList => {
            list.start(now);
            return Event::ListRequested;
        }
        Request::ParameterRead(read) => replies.answer(parameters::read(read, from, parameters)),
        Request::ParameterSet(set) => return parameters::set(set, from, parameters, rates, replies),
        Request::Command(command) if command.requests_message(WIFI_CONFIG_AP_DATA::ID) => {
            return wifi::report(command.number, from, credentials, parameters, replies);
        }
        Request::Command(command) => return execute(command, from, service, rates, replies),
        Request::FileTransfer(transfer) => {
            let (answer, event) = downloads
                .files
                .handle(transfer, from, state, parameters, |id| rates.parameter_set(id));
            replies.answer_any(answer.map(Message::FileAnswer));
            return file_served(event, downloads, now, replies);
        }
        Request::LogList(list) => {
            let result = downloads.logs.list(list, from, state);
            explain_refusal(result, downloads, now, replies);
        }
        Request::LogData(data) => {
            let result = downloads.logs.request_data(data, from, state);
            explain_refusal(result, downloads, now, replies);
        }
        Request::LogEnd => downloads.logs.end(from),
        Request::LogErase => {
            let result = downloads.logs.erase(from, state);
            explain_refusal(result, downloads, now, replies);
            if result.is_ok() {
                return Event::LogsErased;
            }
        }
        Request::DataStream(stream) => rates.request_data_stream(stream, parameters, now),
        Request::Ping(ping) => replies.answer_any(time::ping(ping, from)),
        Request::Timesync(timesync) => replies.answer_any(time::timesync(timesync, from, now)),
        Request::RadioStatus(status) if is_radio(from.component_id, link) => {
            rates.radio_status(status, now);
        }
        Request::RadioStatus(_) => return Event::Ignored,
        Request::SetMode(set_mode) => return service.set_mode_by_message(set_mode, from, replies),
        Request::Control(sticks) => return service.control(sticks),
        Request::Heartbeat(heartbeat) if is_of_ground_station(heartbeat) => {
            service.ground_station_seen();
            if stations.heartbeat(from, now) == Introduction::Due {
                for pack in state.described() {
                    replies.outbox.post_details(pack);
                }
            }
            return Event::GroundStationHeard;
        }
        Request::Heartbeat(_) => return Event::Ignored,
        Request::SetUpSigning(set_up) => {
            let arm_state = service.vehicle.arm_state();
            return signing::set_up(set_up, link, arm_state, signing, now, replies);
        }
        Request::WifiConfig(config) => {
            let arm_state = service.vehicle.arm_state();
            return wifi::set_up(config, arm_state, credentials, parameters, replies);
        }
        Request::PackReading(reading) => {
            return Event::Measured {
                component_id: from.component_id,
                reading: *reading,
            };
        }
    }
    Event::Answered
}

/// Executes a command: a few are for the vehicle, the others for the link or the board.
fn execute(
    command: &Command,
    from: Peer,
    mut service: VehicleService<'_>,
    rates: &mut Rates,
    mut replies: Replies<'_>,
) -> Event {
    if VehicleService::knows(command.number) {
        return service.execute(command, from, replies);
    }
    let outcome = command.execute(&mut rates.scheduler, service.state, service.now);
    if outcome.action.is_some_and(Action::needs_disarmed) && service.vehicle.arm_state() == ArmState::Armed {
        replies.explain(MavSeverity::MAV_SEVERITY_WARNING, DISARM_FIRST);
        replies.acknowledge(command.number, MavResult::MAV_RESULT_FAILED, from);
        return Event::CommandRefused(command.number);
    }
    if let Some(Action::Restart(restart)) = outcome.action {
        service.vehicle.prepare_restart(restart);
    }
    replies.acknowledge(command.number, outcome.result, from);
    match outcome.answer {
        Some(Answer::Message(message)) => replies.answer(message),
        Some(Answer::Streams(requested)) => {
            let state = service.state;
            for stream in requested.reported_in(state) {
                replies.answer(stream.build(state));
            }
        }
        None => {}
    }
    match outcome.action {
        // Even a command that fails for one pack has an effect on the others.
        Some(action) => Event::Command(action),
        None if outcome.result == MavResult::MAV_RESULT_ACCEPTED => Event::Answered,
        None => Event::CommandRefused(command.number),
    }
}

/// Result of a request for files.
fn file_served(event: FileEvent, downloads: &mut Downloads, now: Instant, mut replies: Replies<'_>) -> Event {
    match event {
        FileEvent::Served => Event::Answered,
        FileEvent::ParametersOpened => Event::ListRequested,
        FileEvent::ParametersSet => Event::ParametersSet,
        FileEvent::ParametersNotSet(not_set) => {
            replies.say(MavSeverity::MAV_SEVERITY_WARNING, &not_set.text());
            Event::ParametersSet
        }
        FileEvent::RefusedArmed => {
            explain_refusal(Err(Refusal::Armed), downloads, now, replies);
            Event::Answered
        }
    }
}

/// Reports why a request for logs was refused, if it was.
fn explain_refusal(
    result: Result<(), Refusal>,
    downloads: &mut Downloads,
    now: Instant,
    mut replies: Replies<'_>,
) {
    if let Err(refusal) = result
        && downloads.logs.may_explain(now)
    {
        replies.say(MavSeverity::MAV_SEVERITY_WARNING, refusal.text());
    }
}
