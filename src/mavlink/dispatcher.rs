//! Gives what was received to the service it is for.

use ::mavlink::MessageData;

use super::dialect::{MavResult, MavType, WIFI_CONFIG_AP_DATA};
use super::event::{Action, Event};
use super::parser::{Peer, ReceivedFrame};
use super::rates::is_radio;
use super::requests::{self, Command, Request};
use super::services::commands::{Answer, requested_streams};
use super::services::downloads::Downloads;
use super::services::log_download::Refusal;
use super::services::parameters::{self, ParameterList};
use super::services::vehicle::{VehicleService, may_stop};
use super::services::{
    Changeable, Context, DISARM_FIRST, TOO_LATE, file_transfer, mission, signing, time, wifi,
};
use super::signing::{Access, Authenticity, Effect, LinkKind, Role};
use super::{COMPONENT_ID, Message, build_available_mode};
use crate::announce::Severity;
use crate::parameter::MonitorKind;
use crate::system::SystemState;
use crate::vehicle::{ArmState, ControlMessage, Mode, Presence, VehicleStatus};

/// The type in the HEARTBEAT of a ground station.
const GROUND_STATION: u8 = MavType::MAV_TYPE_GCS as u8;

/// The oldest request of the page that changes something for good, in milliseconds. A figure of its own: `FS_TIMEOUT` may be
/// 100 s.
const MAX_AGE_MS: u32 = 3_000;

/// The greatest effect of a request.
fn effect(request: &Request<'_>) -> Effect {
    match request {
        Request::FileTransfer(transfer) if file_transfer::writes(transfer.opcode) => Effect::Changes,
        Request::RadioStatus { .. } => Effect::RadioReport,
        Request::ParameterList
        | Request::ParameterRead { .. }
        | Request::FileTransfer(_)
        | Request::LogList(_)
        | Request::LogData(_)
        | Request::LogEnd
        | Request::Mission(_)
        | Request::Ping { .. }
        | Request::Timesync { .. } => Effect::Reads,
        Request::Command(command) if command.only_reads() => Effect::Reads,
        Request::Command(_)
        | Request::ParameterSet { .. }
        | Request::DataStream { .. }
        | Request::SetMode { .. }
        | Request::Control { .. }
        | Request::ChannelOverride(_)
        | Request::Heartbeat { .. }
        | Request::SystemTime { .. }
        | Request::SetUpSigning(_)
        | Request::LogErase
        | Request::WifiConfig(_)
        | Request::PackReport(_) => Effect::Changes,
    }
}

/// The services of a link that go on sending after a request.
#[derive(Debug, Default)]
pub struct Services {
    pub list: ParameterList,
    pub downloads: Downloads,
}

/// Handles one frame, and answers it.
pub fn dispatch(frame: &ReceivedFrame<'_>, services: &mut Services, context: &mut Context<'_>) -> Event {
    let system_id = context.changeable.parameters.system_id();
    let Some((target, request)) = requests::decode(frame.message_id, &frame.payload) else {
        return Event::Ignored;
    };
    let from = Peer {
        system_id: frame.system_id,
        component_id: frame.component_id,
    };
    if !target.is_ours(system_id) || !is_expected(&request, from, system_id, context.state) {
        return Event::Ignored;
    }
    let authenticity = context.changeable.signing.check(frame, context.now);
    context.authenticity = authenticity;
    context.presence = if permits(&request, context) {
        // A companion sends as long as the rover has power.
        if from.system_id == system_id {
            Presence::Unknown
        } else {
            note_station(&request, from, context);
            Presence::GroundStation
        }
    } else if may_stop(&request, authenticity, context.changeable.vehicle) {
        Presence::Unknown
    } else {
        return refuse(&request, authenticity, context.unauthorized);
    };
    context.age_ms = context.clocks.age_ms(from, context.now);
    if changes_for_good(&request) && context.age_ms.is_some_and(|age_ms| age_ms > MAX_AGE_MS) {
        return refuse_late(&request, from, context);
    }
    let before = context.changeable.vehicle.status();
    let event = serve(&request, from, services, context);
    if let Request::Command(command) = &request
        && command.changes_for_all()
    {
        let result = context.outbox.latest_result();
        let record = requests::command_record(frame.message_id, &frame.payload, from, result);
        *context.changeable.command = Some(record);
    }
    if matches!(event, Event::Driven) {
        note_driven(&request, before, context);
    }
    event
}

/// A message of another system than ours keeps its station's place, apart from heartbeats, which every stranger sends. Autopilots
/// state their time, too, and are no stations.
fn note_station(request: &Request<'_>, from: Peer, context: &mut Context<'_>) {
    let (stations, now) = (&mut *context.stations, context.now);
    if matches!(request, Request::SystemTime { .. }) && from.component_id != COMPONENT_ID {
        stations.expect_heartbeat(from, now);
    }
    if !matches!(request, Request::Heartbeat { .. }) {
        stations.other_message(from, now);
    }
}

/// The station that drives or has armed the rover can always stop it: signing does not forget its time. A second one with the same
/// ids can by what it has signed since.
fn note_driven(request: &Request<'_>, before: VehicleStatus, context: &mut Context<'_>) {
    let now = context.now;
    let Changeable { vehicle, signing, .. } = &mut context.changeable;
    let after = vehicle.status();
    if matches!(request, Request::Control { .. } | Request::ChannelOverride(_)) {
        signing.keep_sender(Role::Drives);
    } else if before.arm_state != after.arm_state {
        signing.keep_sender(Role::Armed);
        if after.arm_state == ArmState::Armed {
            signing.mark_armed(now);
        }
    } else if before.mode != after.mode && after.mode == Mode::Manual {
        signing.mark_manual(now);
    }
}

/// Whether a request has to be recent, apart from those that move the rover.
fn changes_for_good(request: &Request<'_>) -> bool {
    match request {
        Request::Command(command) => command.changes_for_good(),
        Request::FileTransfer(transfer) => file_transfer::writes(transfer.opcode),
        Request::ParameterSet { .. } | Request::LogErase | Request::WifiConfig(_) => true,
        _ => false,
    }
}

fn refuse_late(request: &Request<'_>, from: Peer, context: &mut Context<'_>) -> Event {
    context.outbox.explain(Severity::Warning, TOO_LATE);
    let Request::Command(command) = request else {
        return Event::Answered;
    };
    context
        .outbox
        .acknowledge(command.number, MavResult::MAV_RESULT_FAILED, from);
    Event::CommandRefused(command.number)
}

/// Whether the sender of a request may do what it asks for.
fn permits(request: &Request<'_>, context: &Context<'_>) -> bool {
    let is_direct = context.link == LinkKind::Direct;
    let is_proven = context.authenticity == Authenticity::Proven;
    match request {
        _ if context.access == Access::Listen => is_proven,
        // Over radio a password needs a signature, even without a key.
        Request::WifiConfig(_) if !is_direct && !is_proven => false,
        // Without this, a lost key could never be replaced where `SIGN_USB_ALLOW` wants everything signed with it.
        Request::SetUpSigning(_) if is_direct && context.changeable.signing.has_lost_key() => true,
        _ => context.permits(effect(request)),
    }
}

/// Counts a request that is not permitted.
fn refuse(request: &Request<'_>, authenticity: Authenticity, unauthorized: &mut u32) -> Event {
    match authenticity {
        Authenticity::Overtaken { .. } => return Event::TooOld,
        Authenticity::Repeated => return Event::Ignored,
        _ => {}
    }
    let is_old = matches!(authenticity, Authenticity::Late | Authenticity::TooOld);
    match request {
        // Every vehicle and ground station around has a heartbeat, many have a clock, and none has a key of ours.
        Request::Heartbeat { system_type } if !is_old || *system_type != GROUND_STATION => {
            return Event::Ignored;
        }
        Request::SystemTime { .. } => return Event::Ignored,
        _ => {}
    }
    *unauthorized = unauthorized.wrapping_add(1);
    if is_old {
        return Event::TooOld;
    }
    Event::Unauthorized { count: *unauthorized }
}

/// Whether a BATTERY_STATUS or BATTERY_INFO is of a pack that another component of this vehicle measures, and by one: other
/// packs and vehicles have theirs, which do not concern this one, signed or not.
fn is_expected(request: &Request<'_>, from: Peer, system_id: u8, state: &SystemState<'_>) -> bool {
    let Request::PackReport(report) = request else {
        return true;
    };
    from.system_id == system_id
        && from.component_id != COMPONENT_ID
        && state.kind(report.pack()) == Some(MonitorKind::External)
}

/// Does what was asked for.
// Apart from its only caller it would take 0.4 KB more.
#[inline(always)]
fn serve(request: &Request<'_>, from: Peer, services: &mut Services, context: &mut Context<'_>) -> Event {
    let (now, state) = (context.now, context.state);
    let Services { list, downloads } = services;
    downloads.end_by_arming(state);
    match request {
        Request::ParameterList => {
            list.start(now);
            Event::ListRequested
        }
        Request::ParameterRead { index, name } => parameters::read(*index, *name, from, context),
        Request::ParameterSet { name, value } => parameters::set(*name, *value, from, context),
        Request::Command(command) => execute(command, from, context),
        Request::FileTransfer(transfer) => {
            let result = downloads.files.handle(transfer, from, context);
            explained(result, downloads, context)
        }
        Request::LogList(list) => {
            let result = downloads.logs.list(list, from, state);
            explained(result.map(|()| Event::Answered), downloads, context)
        }
        Request::LogData(data) => {
            let result = downloads.logs.request_data(data, from, state);
            explained(result.map(|()| Event::Answered), downloads, context)
        }
        Request::LogEnd => {
            downloads.logs.end(from);
            Event::Answered
        }
        Request::LogErase => {
            let result = downloads.erase_logs(from, context.link_number, state);
            explained(result.map(|()| Event::LogsErased), downloads, context)
        }
        Request::DataStream { stream_id, rate_hz } => {
            let parameters = &*context.changeable.parameters;
            context
                .rates
                .request_data_stream(from, *stream_id, *rate_hz, parameters, now);
            Event::Answered
        }
        Request::Mission(request) => {
            context.outbox.answer(mission::answer(request, from));
            Event::Answered
        }
        Request::Ping {
            time_us,
            sequence,
            target,
        } => time::ping(*time_us, *sequence, *target, from, context),
        Request::Timesync {
            answered_ns,
            asked_ns,
        } => time::timesync(*answered_ns, *asked_ns, from, context),
        Request::SystemTime { unix_us, boot_ms } => time::system_time(*unix_us, *boot_ms, from, context),
        Request::RadioStatus { free_percent } if is_radio(from.component_id, context.link) => {
            context.rates.scheduler.radio_buffer_free(*free_percent, now);
            Event::Answered
        }
        Request::RadioStatus { .. } => Event::Ignored,
        Request::SetMode {
            base_mode,
            custom_mode,
        } => VehicleService::of(context).set_mode_by_message(*base_mode, *custom_mode, from),
        Request::Control { throttle, steering } => {
            let message = ControlMessage::ManualControl;
            VehicleService::of(context).control(*throttle, *steering, message, from)
        }
        Request::ChannelOverride(pulses_us) => {
            VehicleService::of(context).control_by_channels(pulses_us, from)
        }
        Request::Heartbeat { system_type }
            if (*system_type, context.presence) == (GROUND_STATION, Presence::GroundStation) =>
        {
            heard(from, context)
        }
        Request::Heartbeat { .. } => Event::Ignored,
        Request::SetUpSigning(set_up) => signing::set_up(set_up, context),
        Request::WifiConfig(config) => wifi::set_up(config, context),
        Request::PackReport(report) => Event::Measured {
            component_id: from.component_id,
            report: *report,
        },
    }
}

/// HEARTBEAT of a ground station. One that is new learns what smart batteries are.
fn heard(from: Peer, context: &mut Context<'_>) -> Event {
    context
        .changeable
        .vehicle
        .ground_station_seen(context.received_at);
    if !context.stations.heartbeat(from, context.now) {
        return Event::GroundStationHeard;
    }
    for pack in context.state.described() {
        context.outbox.post_details(pack);
    }
    Event::GroundStationIntroduced
}

/// Executes a command: a few are for the vehicle or Wi-Fi, the others for the link or the board.
fn execute(command: &Command, from: Peer, context: &mut Context<'_>) -> Event {
    if command.requests_message(WIFI_CONFIG_AP_DATA::ID) {
        return wifi::report(command.number, from, context);
    }
    if VehicleService::knows(command.number) {
        return VehicleService::of(context).execute(command, from);
    }
    let (state, vehicle, outbox) = (
        context.state,
        &mut *context.changeable.vehicle,
        &mut *context.outbox,
    );
    let outcome = command.execute(&mut context.rates.scheduler, state, context.now);
    if outcome.action.is_some_and(Action::needs_disarmed) && vehicle.arm_state() == ArmState::Armed {
        outbox.explain(Severity::Warning, DISARM_FIRST);
        outbox.acknowledge(command.number, MavResult::MAV_RESULT_FAILED, from);
        return Event::CommandRefused(command.number);
    }
    if let Some(Action::Restart(restart)) = outcome.action {
        vehicle.prepare_restart(restart);
    }
    if outcome.result == MavResult::MAV_RESULT_UNSUPPORTED
        && let Some(alternative) = command.alternative()
    {
        outbox.explain(Severity::Warning, alternative);
    }
    outbox.acknowledge(command.number, outcome.result, from);
    match outcome.answer {
        Some(Answer::Message(message)) => outbox.answer(message),
        Some(Answer::Modes) => {
            for mode in Mode::ALL {
                outbox.answer(Message::AvailableModes(build_available_mode(mode)));
            }
        }
        Some(Answer::Streams(message_id, pack)) => {
            for stream in requested_streams(message_id, pack, state) {
                outbox.answer(stream.build(state));
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

/// Says why a download was refused, if it was.
fn explained(result: Result<Event, Refusal>, downloads: &mut Downloads, context: &mut Context<'_>) -> Event {
    result.unwrap_or_else(|refusal| {
        if downloads.logs.may_explain(context.now) {
            context.outbox.say(Severity::Warning, refusal.text());
        }
        Event::Answered
    })
}
