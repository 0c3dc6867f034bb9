//! The messages that are sent, each of its own type.

use ::mavlink::{MAVLinkV2MessageRaw, MavHeader};

use super::command_ack::CommandAck;
use super::file_transfer::FileTransferNak;
use super::{
    build_battery_info, build_battery_status, build_battery_status_v2, build_fuel_status, build_heartbeat,
    build_smart_battery_info, build_sys_status,
};
use crate::mavlink::SystemState;
use crate::mavlink::dialect::{
    AUTOPILOT_VERSION_DATA, BATTERY_INFO_DATA, BATTERY_STATUS_DATA, BATTERY_STATUS_V2_DATA, FUEL_STATUS_DATA,
    HEARTBEAT_DATA, MESSAGE_INTERVAL_DATA, PARAM_ERROR_DATA, PARAM_VALUE_DATA, PING_DATA,
    PROTOCOL_VERSION_DATA, SMART_BATTERY_INFO_DATA, STATUSTEXT_DATA, SYS_STATUS_DATA, TIMESYNC_DATA,
};

/// Something that is sent regularly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Stream {
    /// HEARTBEAT
    Heartbeat,
    /// SYS_STATUS
    SysStatus,
    /// BATTERY_STATUS of this instance
    BatteryStatus(u8),
    /// BATTERY_STATUS_V2 of this instance
    BatteryStatusV2(u8),
    /// BATTERY_INFO of this instance
    BatteryInfo(u8),
    /// SMART_BATTERY_INFO of this instance
    SmartBatteryInfo(u8),
    /// FUEL_STATUS of this instance
    FuelStatus(u8),
}

impl Stream {
    /// The pack it is of; `None` for one of the whole vehicle.
    fn instance(self) -> Option<u8> {
        match self {
            Self::Heartbeat | Self::SysStatus => None,
            Self::BatteryStatus(instance)
            | Self::BatteryStatusV2(instance)
            | Self::BatteryInfo(instance)
            | Self::SmartBatteryInfo(instance)
            | Self::FuelStatus(instance) => Some(instance),
        }
    }

    /// Whether there is something to tell: not of a pack that is not reported, and of fuel only if it is a tank.
    pub(in crate::mavlink) fn is_reported_in(self, state: &SystemState<'_>) -> bool {
        let is_reported = self.instance().is_none_or(|instance| state.is_reported(instance));
        match self {
            Self::FuelStatus(instance) => is_reported && state.is_tank(instance),
            _ => is_reported,
        }
    }

    /// The message of this stream, from the state at this moment.
    pub fn build(self, state: &SystemState<'_>) -> Message {
        match self {
            Self::Heartbeat => Message::Heartbeat(build_heartbeat(state)),
            Self::SysStatus => Message::SysStatus(build_sys_status(state)),
            Self::BatteryStatus(instance) => Message::BatteryStatus(build_battery_status(state, instance)),
            Self::BatteryStatusV2(instance) => {
                Message::BatteryStatusV2(build_battery_status_v2(state, instance))
            }
            Self::BatteryInfo(instance) => Message::BatteryInfo(build_battery_info(state, instance)),
            Self::SmartBatteryInfo(instance) => {
                Message::SmartBatteryInfo(build_smart_battery_info(state, instance))
            }
            Self::FuelStatus(instance) => Message::FuelStatus(build_fuel_status(state, instance)),
        }
    }
}

/// A message on its way out.
///
/// The `mavlink` crate's own enum of all messages would link the serialisers of the whole dialect (over 100 KB).
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// HEARTBEAT (0)
    Heartbeat(HEARTBEAT_DATA),
    /// SYS_STATUS (1)
    SysStatus(SYS_STATUS_DATA),
    /// PING (4)
    Ping(PING_DATA),
    /// PARAM_VALUE (22)
    ParamValue(PARAM_VALUE_DATA),
    /// COMMAND_ACK (77)
    CommandAck(CommandAck),
    /// FILE_TRANSFER_PROTOCOL (110)
    FileTransferNak(FileTransferNak),
    /// TIMESYNC (111)
    Timesync(TIMESYNC_DATA),
    /// BATTERY_STATUS (147)
    BatteryStatus(BATTERY_STATUS_DATA),
    /// AUTOPILOT_VERSION (148)
    AutopilotVersion(AUTOPILOT_VERSION_DATA),
    /// MESSAGE_INTERVAL (244)
    MessageInterval(MESSAGE_INTERVAL_DATA),
    /// STATUSTEXT (253)
    StatusText(STATUSTEXT_DATA),
    /// PROTOCOL_VERSION (300)
    ProtocolVersion(PROTOCOL_VERSION_DATA),
    /// PARAM_ERROR (345)
    ParamError(PARAM_ERROR_DATA),
    /// BATTERY_STATUS_V2 (369)
    BatteryStatusV2(BATTERY_STATUS_V2_DATA),
    /// SMART_BATTERY_INFO (370)
    SmartBatteryInfo(SMART_BATTERY_INFO_DATA),
    /// FUEL_STATUS (371)
    FuelStatus(FUEL_STATUS_DATA),
    /// BATTERY_INFO (372)
    BatteryInfo(BATTERY_INFO_DATA),
}

impl Message {
    /// Writes the message as a MAVLink 2 frame into `frame`.
    pub(in crate::mavlink) fn serialize(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw) {
        match self {
            Self::Heartbeat(data) => frame.serialize_message_data(header, data),
            Self::SysStatus(data) => frame.serialize_message_data(header, data),
            Self::Ping(data) => frame.serialize_message_data(header, data),
            Self::ParamValue(data) => frame.serialize_message_data(header, data),
            Self::CommandAck(data) => frame.serialize_message_data(header, data),
            Self::FileTransferNak(data) => frame.serialize_message_data(header, data),
            Self::Timesync(data) => frame.serialize_message_data(header, data),
            Self::BatteryStatus(data) => frame.serialize_message_data(header, data),
            Self::AutopilotVersion(data) => frame.serialize_message_data(header, data),
            Self::MessageInterval(data) => frame.serialize_message_data(header, data),
            Self::StatusText(data) => frame.serialize_message_data(header, data),
            Self::ProtocolVersion(data) => frame.serialize_message_data(header, data),
            Self::ParamError(data) => frame.serialize_message_data(header, data),
            Self::BatteryStatusV2(data) => frame.serialize_message_data(header, data),
            Self::SmartBatteryInfo(data) => frame.serialize_message_data(header, data),
            Self::FuelStatus(data) => frame.serialize_message_data(header, data),
            Self::BatteryInfo(data) => frame.serialize_message_data(header, data),
        }
    }
}
