//! Requests of received messages.
//!
//! Only this folder knows where the fields of a received payload are. They are read one by one: the `mavlink` crate refuses a
//! whole message whose enum has a value that the dialect does not know, a command's number for one, and what is refused
//! can't be answered.

mod battery_status;

use ::mavlink::MessageData;
use heapless::Vec;
use num_traits::FromPrimitive;

use super::COMPONENT_ID;
use super::dialect::MavResult;
use super::dialect::{
    BATTERY_INFO_DATA, BATTERY_STATUS_DATA, BATTERY_STATUS_V2_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA,
    FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA, LOG_ERASE_DATA, LOG_REQUEST_DATA_DATA, LOG_REQUEST_END_DATA,
    LOG_REQUEST_LIST_DATA, MANUAL_CONTROL_DATA, MISSION_CLEAR_ALL_DATA, MISSION_COUNT_DATA,
    MISSION_ITEM_INT_DATA, MISSION_REQUEST_INT_DATA, MISSION_REQUEST_LIST_DATA,
    MISSION_REQUEST_PARTIAL_LIST_DATA, MISSION_WRITE_PARTIAL_LIST_DATA, MavMissionType,
    PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PING_DATA, RADIO_STATUS_DATA,
    RC_CHANNELS_OVERRIDE_DATA, REQUEST_DATA_STREAM_DATA, SET_MODE_DATA, SETUP_SIGNING_DATA, SYSTEM_TIME_DATA,
    TIMESYNC_DATA, WIFI_CONFIG_AP_DATA,
};
use super::parser::Peer;
use super::payload::{Name, Payload};
use super::signing::{SigningKey, Timestamp};
use crate::pack::Pack;
use crate::recorder::dataflash::{COMMAND_FIELD_BYTES, CommandRecord};
use crate::sensor::{ExternalHealth, ExternalReport};
use crate::vehicle::StickInput;
pub(super) use battery_status::{FLAGS_OF_FAULTS, FLAGS_OF_MODES};
use battery_status::{pack_reading, pack_reading_v2};

/// MISSION_ITEM and MISSION_REQUEST, which are deprecated in the dialect and still sent.
const MISSION_ITEM_ID: u32 = 39;
const MISSION_REQUEST_ID: u32 = 40;

/// Channels of RC_CHANNELS_OVERRIDE that a stick can have.
const CHANNELS: usize = 8;

/// The system or component that a message is addressed to. Id 0 stands for all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The message has no target.
    Everyone,
    System(u8),
    /// This system only: control inputs and keys are for one rover.
    OnlySystem(u8),
    Component(Peer),
    /// A component of this system only.
    OnlyComponent(Peer),
}

impl Target {
    /// Whether the vehicle with this system id is addressed.
    pub fn is_ours(self, our_system_id: u8) -> bool {
        let is_our_system = |id| [0, our_system_id].contains(&id);
        let is_our_component = |id| [0, COMPONENT_ID].contains(&id);
        match self {
            Self::Everyone => true,
            Self::System(system_id) => is_our_system(system_id),
            Self::OnlySystem(system_id) => system_id == our_system_id,
            Self::Component(target) => {
                is_our_system(target.system_id) && is_our_component(target.component_id)
            }
            Self::OnlyComponent(target) => {
                target.system_id == our_system_id && is_our_component(target.component_id)
            }
        }
    }
}

/// The request of a message.
#[derive(Clone, Debug, PartialEq)]
pub enum Request<'a> {
    ParameterList,
    /// PARAM_REQUEST_READ.
    ParameterRead {
        /// −1 if it is asked for by name.
        index: i16,
        name: Name,
    },
    /// PARAM_SET.
    ParameterSet {
        name: Name,
        value: f32,
    },
    Command(Command),
    FileTransfer(FileTransfer<'a>),
    LogList(LogListRequest),
    LogData(LogDataRequest),
    /// LOG_ERASE.
    LogErase,
    /// LOG_REQUEST_END.
    LogEnd,
    /// REQUEST_DATA_STREAM.
    DataStream {
        stream_id: u8,
        /// `None` to stop it.
        rate_hz: Option<u16>,
    },
    /// PING.
    Ping {
        time_us: u64,
        sequence: u32,
        /// 0 and 0 in a request; in an answer the peer that sent the request.
        target: Peer,
    },
    /// TIMESYNC.
    Timesync {
        /// The time at the peer that answers, in ns; 0 in a request.
        answered_ns: i64,
        /// The time at the peer that asks, in ns.
        asked_ns: i64,
    },
    /// SYSTEM_TIME.
    SystemTime {
        /// UTC in µs since 1970, or 0 if the sender does not know.
        unix_us: u64,
        /// Time since the sender's start in ms, or 0 if it does not state one.
        boot_ms: u32,
    },
    /// RADIO_STATUS.
    RadioStatus {
        /// The share of the transmit buffer that is free.
        free_percent: u8,
    },
    /// SET_MODE.
    SetMode {
        base_mode: u8,
        custom_mode: u32,
    },
    /// MANUAL_CONTROL.
    Control {
        throttle: StickInput,
        steering: StickInput,
    },
    /// RC_CHANNELS_OVERRIDE: pulses of channels 1 to 8 in µs, 0 to release one, 65535 to leave it as it is.
    ChannelOverride([u16; CHANNELS]),
    /// HEARTBEAT.
    Heartbeat {
        /// A number of `MAV_TYPE`.
        system_type: u8,
    },
    SetUpSigning(SetUpSigning),
    /// BATTERY_STATUS, BATTERY_STATUS_V2, BATTERY_INFO.
    PackReport(ExternalReport),
    WifiConfig(WifiConfig<'a>),
    Mission(Mission),
}

/// COMMAND_LONG or COMMAND_INT, any number. Ground stations fill parameters they don't use with NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct Command {
    pub number: u16,
    pub param1: f32,
    pub param2: f32,
    pub param3: f32,
    pub param4: f32,
}

/// FILE_TRANSFER_PROTOCOL.
#[derive(Clone, Debug, PartialEq)]
pub struct FileTransfer<'a> {
    pub sequence: u16,
    pub session: u8,
    pub opcode: u8,
    /// Bytes of data, or that are asked for.
    pub size: u8,
    pub offset: u32,
    pub payload: Payload<'a>,
}

impl FileTransfer<'_> {
    /// The bytes of data.
    pub fn data(&self) -> impl Iterator<Item = u8> {
        const DATA_AT: usize = 15;
        (DATA_AT..DATA_AT + usize::from(self.size)).map(|at| self.payload.u8(at))
    }
}

/// LOG_REQUEST_LIST.
#[derive(Clone, Debug, PartialEq)]
pub struct LogListRequest {
    pub start: u16,
    pub end: u16,
}

/// LOG_REQUEST_DATA.
#[derive(Clone, Debug, PartialEq)]
pub struct LogDataRequest {
    pub id: u16,
    pub offset: u32,
    pub bytes: u32,
}

/// SETUP_SIGNING.
#[derive(Clone, Debug, PartialEq)]
pub struct SetUpSigning {
    /// `None` to remove the key.
    pub key: Option<SigningKey>,
    /// `None` if it leaves less than a year of what 48 bits hold.
    pub time: Option<Timestamp>,
}

/// WIFI_CONFIG_AP.
#[derive(Clone, Debug, PartialEq)]
pub struct WifiConfig<'a> {
    /// A number of `WIFI_CONFIG_AP_MODE`, or any other.
    pub mode: u8,
    pub payload: Payload<'a>,
}

impl WifiConfig<'_> {
    /// The name of the network, empty if it is not given.
    pub fn ssid(&self) -> Vec<u8, 32> {
        self.payload.text(0)
    }

    /// The password, empty if it is not given.
    pub fn password(&self) -> Vec<u8, 64> {
        self.payload.text(32)
    }
}

/// A message of the mission protocol.
#[derive(Clone, Debug, PartialEq)]
pub struct Mission {
    /// Mission, fence, rally points, or all of them.
    pub list: MavMissionType,
    pub request: MissionRequest,
}

/// A request for a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MissionRequest {
    /// MISSION_REQUEST_LIST.
    List,
    /// MISSION_CLEAR_ALL.
    Clear,
    /// MISSION_COUNT.
    Store { items: u16 },
    /// One item or several is asked for or sent.
    Item,
}

/// Target and request of a message; `None` if it has no effect here.
pub fn decode<'a>(message_id: u32, payload: &Payload<'a>) -> Option<(Target, Request<'a>)> {
    Some(match message_id {
        HEARTBEAT_DATA::ID => heartbeat(payload),
        PING_DATA::ID => ping(payload),
        SET_MODE_DATA::ID => set_mode(payload),
        PARAM_REQUEST_READ_DATA::ID => param_request_read(payload),
        PARAM_REQUEST_LIST_DATA::ID => param_request_list(payload),
        PARAM_SET_DATA::ID => param_set(payload),
        REQUEST_DATA_STREAM_DATA::ID => request_data_stream(payload),
        MANUAL_CONTROL_DATA::ID => manual_control(payload),
        RC_CHANNELS_OVERRIDE_DATA::ID => rc_channels_override(payload),
        COMMAND_INT_DATA::ID | COMMAND_LONG_DATA::ID => command(payload),
        RADIO_STATUS_DATA::ID => radio_status(payload),
        FILE_TRANSFER_PROTOCOL_DATA::ID => file_transfer(payload),
        TIMESYNC_DATA::ID => timesync(payload),
        SYSTEM_TIME_DATA::ID => system_time(payload),
        LOG_REQUEST_LIST_DATA::ID => log_request_list(payload),
        LOG_REQUEST_DATA_DATA::ID => log_request_data(payload),
        LOG_ERASE_DATA::ID => (Target::Component(target_at(payload, 0)), Request::LogErase),
        LOG_REQUEST_END_DATA::ID => (Target::Component(target_at(payload, 0)), Request::LogEnd),
        SETUP_SIGNING_DATA::ID => setup_signing(payload),
        BATTERY_STATUS_DATA::ID => battery_status(payload)?,
        BATTERY_STATUS_V2_DATA::ID => battery_status_v2(payload)?,
        BATTERY_INFO_DATA::ID => battery_info(payload)?,
        WIFI_CONFIG_AP_DATA::ID => wifi_config_ap(payload)?,
        MISSION_REQUEST_LIST_DATA::ID => mission(payload, 0, MissionRequest::List)?,
        MISSION_CLEAR_ALL_DATA::ID => mission(payload, 0, MissionRequest::Clear)?,
        MISSION_COUNT_DATA::ID => mission(
            payload,
            2,
            MissionRequest::Store {
                items: payload.u16(0),
            },
        )?,
        MISSION_REQUEST_ID | MISSION_REQUEST_INT_DATA::ID => mission(payload, 2, MissionRequest::Item)?,
        MISSION_REQUEST_PARTIAL_LIST_DATA::ID | MISSION_WRITE_PARTIAL_LIST_DATA::ID => {
            mission(payload, 4, MissionRequest::Item)?
        }
        MISSION_ITEM_ID | MISSION_ITEM_INT_DATA::ID => item(payload)?,
        _ => return None,
    })
}

/// `target_system`, which is there, and `target_component`, which always follows it.
// Inlined, it would be repeated for each message with a target.
#[inline(never)]
fn target_at(payload: &Payload<'_>, target_system_at: usize) -> Peer {
    Peer {
        system_id: payload.u8(target_system_at),
        component_id: payload.u8(target_system_at + 1),
    }
}

fn heartbeat(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let heartbeat = Request::Heartbeat {
        system_type: payload.u8(4),
    };
    (Target::Everyone, heartbeat)
}

fn ping(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 12);
    let ping = Request::Ping {
        time_us: payload.u64(0),
        sequence: payload.u32(8),
        target,
    };
    (Target::Component(target), ping)
}

fn set_mode(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target_system = payload.u8(4);
    let set_mode = Request::SetMode {
        custom_mode: payload.u32(0),
        base_mode: payload.u8(5),
    };
    (Target::System(target_system), set_mode)
}

fn param_request_read(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 2);
    let read = Request::ParameterRead {
        index: payload.i16(0),
        name: payload.name(4),
    };
    (Target::Component(target), read)
}

fn param_request_list(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 0);
    (Target::Component(target), Request::ParameterList)
}

fn param_set(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 4);
    let set = Request::ParameterSet {
        value: payload.f32(0),
        name: payload.name(6),
    };
    (Target::Component(target), set)
}

fn request_data_stream(payload: &Payload<'_>) -> (Target, Request<'static>) {
    const STOP: u8 = 0;
    let target = target_at(payload, 2);
    let req_message_rate_hz = payload.u16(0);
    let start_stop = payload.u8(5);
    let stream = Request::DataStream {
        stream_id: payload.u8(4),
        rate_hz: (start_stop != STOP).then_some(req_message_rate_hz),
    };
    (Target::Component(target), stream)
}

/// ArduPilot's Rover steers by the axis y and takes z for its throttle.
fn manual_control(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = payload.u8(10);
    let sticks = Request::Control {
        steering: StickInput::of_axis(payload.i16(2)),
        throttle: StickInput::of_axis(payload.i16(4)),
    };
    (Target::OnlySystem(target), sticks)
}

fn rc_channels_override(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 16);
    let pulses_us = core::array::from_fn(|channel| payload.u16(2 * channel));
    (Target::OnlyComponent(target), Request::ChannelOverride(pulses_us))
}

/// These fields are at the same places in COMMAND_LONG and COMMAND_INT.
fn command(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 30);
    let command = Command {
        param1: payload.f32(0),
        param2: payload.f32(4),
        param3: payload.f32(8),
        param4: payload.f32(12),
        number: payload.u16(28),
    };
    (Target::Component(target), Request::Command(command))
}

/// The record of a command in the log, with its result. `message_id` is that of COMMAND_LONG or COMMAND_INT.
pub fn command_record(
    message_id: u32,
    payload: &Payload<'_>,
    from: Peer,
    result: MavResult,
) -> CommandRecord {
    let was_long = message_id == COMMAND_LONG_DATA::ID;
    // Byte by byte: from an array of this size the compiler would unroll the loop.
    let mut fields = [0; COMMAND_FIELD_BYTES];
    for (at, byte) in fields.iter_mut().enumerate() {
        *byte = payload.u8(at);
    }
    if was_long {
        for (at, place) in fields.as_chunks_mut().0.iter_mut().enumerate().skip(4).take(2) {
            *place = (payload.f32(4 * at) as i32).to_le_bytes();
        }
    }
    CommandRecord {
        target: payload.bytes(30),
        sender: [from.system_id, from.component_id],
        // Of COMMAND_LONG it is the confirmation.
        frame: if was_long { 0 } else { payload.u8(32) },
        number: payload.u16(28),
        fields,
        result: result as u8,
        was_long,
    }
}

fn radio_status(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let status = Request::RadioStatus {
        free_percent: payload.u8(6),
    };
    (Target::Everyone, status)
}

/// The header of MAVLink FTP follows three bytes of addressing.
fn file_transfer<'a>(payload: &Payload<'a>) -> (Target, Request<'a>) {
    let target = target_at(payload, 1);
    let transfer = FileTransfer {
        sequence: payload.u16(3),
        session: payload.u8(5),
        opcode: payload.u8(6),
        size: payload.u8(7),
        offset: payload.u32(11),
        payload: *payload,
    };
    (Target::Component(target), Request::FileTransfer(transfer))
}

fn log_request_list(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 4);
    let list = LogListRequest {
        start: payload.u16(0),
        end: payload.u16(2),
    };
    (Target::Component(target), Request::LogList(list))
}

fn log_request_data(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 10);
    let data = LogDataRequest {
        offset: payload.u32(0),
        bytes: payload.u32(4),
        id: payload.u16(8),
    };
    (Target::Component(target), Request::LogData(data))
}

fn timesync(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target = target_at(payload, 16);
    let timesync = Request::Timesync {
        answered_ns: payload.i64(0),
        asked_ns: payload.i64(8),
    };
    (Target::Component(target), timesync)
}

fn system_time(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let time = Request::SystemTime {
        unix_us: payload.u64(0),
        boot_ms: payload.u32(8),
    };
    (Target::Everyone, time)
}

fn battery_status(payload: &Payload<'_>) -> Option<(Target, Request<'static>)> {
    let report = ExternalReport::Reading(pack_reading(payload)?);
    Some((Target::Everyone, Request::PackReport(report)))
}

fn battery_status_v2(payload: &Payload<'_>) -> Option<(Target, Request<'static>)> {
    let report = ExternalReport::ReadingV2(pack_reading_v2(payload)?);
    Some((Target::Everyone, Request::PackReport(report)))
}

/// `None` if there is no such pack.
fn battery_info(payload: &Payload<'_>) -> Option<(Target, Request<'static>)> {
    let pack = Pack::from_instance(payload.u8(44))?;
    let cycle_count = payload.u16(40);
    let health_pct = payload.u8(47);
    let health = ExternalHealth {
        cycle_count: (cycle_count != u16::MAX).then_some(cycle_count),
        state_of_health_pct: (health_pct <= 100).then_some(health_pct),
    };
    Some((
        Target::Everyone,
        Request::PackReport(ExternalReport::Health(pack, health)),
    ))
}

/// The message has no target. One with a response is another vehicle's answer.
fn wifi_config_ap<'a>(payload: &Payload<'a>) -> Option<(Target, Request<'a>)> {
    const NO_RESPONSE: u8 = 0;
    let config = WifiConfig {
        mode: payload.u8(96),
        payload: *payload,
    };
    let is_request = payload.u8(97) == NO_RESPONSE;
    is_request.then_some((Target::Everyone, Request::WifiConfig(config)))
}

/// The list follows the target; of one that MAVLink does not know there is nothing to say.
fn mission(
    payload: &Payload<'_>,
    target_at_byte: usize,
    request: MissionRequest,
) -> Option<(Target, Request<'static>)> {
    mission_of(payload, target_at_byte, target_at_byte + 2, request)
}

fn item(payload: &Payload<'_>) -> Option<(Target, Request<'static>)> {
    mission_of(payload, 32, 37, MissionRequest::Item)
}

#[inline(never)]
fn mission_of(
    payload: &Payload<'_>,
    target_at_byte: usize,
    list_at_byte: usize,
    request: MissionRequest,
) -> Option<(Target, Request<'static>)> {
    let list = MavMissionType::from_u8(payload.u8(list_at_byte))?;
    let target = target_at(payload, target_at_byte);
    Some((
        Target::Component(target),
        Request::Mission(Mission { list, request }),
    ))
}

fn setup_signing(payload: &Payload<'_>) -> (Target, Request<'static>) {
    let target_system = payload.u8(8);
    let set_up = SetUpSigning {
        time: Timestamp::from_ticks(payload.u64(0)).filter(|time| time.leaves_a_year()),
        key: SigningKey::new(payload.bytes(10)),
    };
    (Target::OnlySystem(target_system), Request::SetUpSigning(set_up))
}

#[cfg(test)]
mod tests;
