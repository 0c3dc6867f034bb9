//! The messages that are sent: a row for each in the table below, and a plain function that builds it, every field set
//! explicitly: the dialect's default of an empty bit mask is its first flag. A builder returns its message's own type, as the
//! dialect's enum would link the serialisers of all messages, more than 100 KB of flash.

mod battery_info;
mod battery_status;
mod battery_status_v2;
mod command;
mod component_metadata;
mod declare;
mod file_transfer;
mod fuel_status;
mod heartbeat;
mod named_value_float;
mod pack_facts;
mod status_text;
mod stream;
mod sys_status;
mod units;
mod version;

use ::mavlink::{MAVLinkV2MessageRaw, MavHeader, MessageData};

pub use battery_info::{build_battery_info, build_smart_battery_info};
pub use battery_status::build_battery_status;
pub use battery_status_v2::build_battery_status_v2;
pub use command::{BroadcastCommand, CommandAck};
pub use component_metadata::{ComponentMetadata, build_component_metadata};
pub use file_transfer::{
    Burst, FileAnswer, FileAnswerHeader, FileData, FileError, FileOutcome, MAX_FILE_BYTES,
};
pub use fuel_status::build_fuel_status;
pub use heartbeat::build_heartbeat;
pub use named_value_float::{
    build_charge_deviation, build_resistance, build_resting_voltage, build_usable_charge,
};
pub(super) use status_text::chunks_of;
pub use status_text::status_texts;
pub use stream::{DefaultRate, StreamGroup, Subject};
pub use sys_status::build_sys_status;
pub use version::{build_autopilot_version, build_available_mode, build_protocol_version};

use super::dialect::{
    AUTOPILOT_VERSION_DATA, AVAILABLE_MODES_DATA, BATTERY_INFO_DATA, BATTERY_STATUS_DATA,
    BATTERY_STATUS_V2_DATA, FUEL_STATUS_DATA, HEARTBEAT_DATA, LOG_DATA_DATA, LOG_ENTRY_DATA,
    MESSAGE_INTERVAL_DATA, MISSION_ACK_DATA, MISSION_COUNT_DATA, NAMED_VALUE_FLOAT_DATA, PARAM_ERROR_DATA,
    PARAM_VALUE_DATA, PING_DATA, PROTOCOL_VERSION_DATA, SMART_BATTERY_INFO_DATA, STATUSTEXT_DATA,
    SYS_STATUS_DATA, TIMESYNC_DATA, WIFI_CONFIG_AP_DATA,
};
use crate::pack::{MAX_PACKS, Pack};
use crate::system::SystemState;

// Each row of a stream: the message, its default rate, of packs also which ones, its builder. When the wire is shared,
// streams take turns in this order.
declare::messages! {
    streams of the vehicle {
        Heartbeat(HEARTBEAT_DATA): DefaultRate::EverySecond, build_heartbeat;
        SysStatus(SYS_STATUS_DATA): DefaultRate::Extra1(StreamGroup::ExtendedStatus), build_sys_status;
    }
    streams of packs {
        BatteryStatus(BATTERY_STATUS_DATA): DefaultRate::Extra1(StreamGroup::Extra3), Subject::EachPack, build_battery_status;
        BatteryStatusV2(BATTERY_STATUS_V2_DATA): DefaultRate::OnRequest, Subject::EachPack, build_battery_status_v2;
        BatteryInfo(BATTERY_INFO_DATA): DefaultRate::OnChange, Subject::EachPack, build_battery_info;
        SmartBatteryInfo(SMART_BATTERY_INFO_DATA): DefaultRate::OnChange, Subject::EachPack, build_smart_battery_info;
        FuelStatus(FUEL_STATUS_DATA): DefaultRate::OnRequest, Subject::EachTank, build_fuel_status;
        Resistance(NAMED_VALUE_FLOAT_DATA): DefaultRate::OnRequest, Subject::EachKnownResistance, build_resistance;
        RestingVoltage(NAMED_VALUE_FLOAT_DATA): DefaultRate::OnRequest, Subject::EachKnownRestingVoltage, build_resting_voltage;
        ChargeDeviation(NAMED_VALUE_FLOAT_DATA): DefaultRate::OnRequest, Subject::EachKnownDeviation, build_charge_deviation;
        UsableCharge(NAMED_VALUE_FLOAT_DATA): DefaultRate::OnRequest, Subject::EachKnownUsableCharge, build_usable_charge;
    }
    answers {
        Ping(PING_DATA);
        ParamValue(PARAM_VALUE_DATA);
        CommandAck(CommandAck);
        BroadcastCommand(BroadcastCommand);
        FileAnswer(FileAnswer);
        Timesync(TIMESYNC_DATA);
        LogEntry(LOG_ENTRY_DATA);
        LogData(LOG_DATA_DATA);
        AutopilotVersion(AUTOPILOT_VERSION_DATA);
        MessageInterval(MESSAGE_INTERVAL_DATA);
        StatusText(STATUSTEXT_DATA);
        ProtocolVersion(PROTOCOL_VERSION_DATA);
        ParamError(PARAM_ERROR_DATA);
        WifiConfig(WIFI_CONFIG_AP_DATA);
        MissionCount(MISSION_COUNT_DATA);
        MissionAck(MISSION_ACK_DATA);
        AvailableModes(AVAILABLE_MODES_DATA);
        ComponentMetadata(ComponentMetadata);
    }
}

impl StreamKind {
    /// The streams with this message id: none unless it can be sent regularly, several of NAMED_VALUE_FLOAT.
    pub fn with_message_id(message_id: u32) -> impl Iterator<Item = Self> {
        let kinds = Self::ALL.into_iter();
        kinds.filter(move |kind| kind.message_id() == message_id)
    }

    /// Its streams: one of the vehicle, or one of each pack that can be.
    pub fn streams(self) -> impl Iterator<Item = Stream> + Clone {
        let count = match self.subject() {
            Subject::Vehicle => 1,
            _ => MAX_PACKS,
        };
        let packs = Pack::ALL.into_iter().take(count);
        packs.map(move |pack| self.of(pack))
    }

    /// Its streams that have something to report.
    pub(in crate::mavlink) fn reported_in(self, state: &SystemState<'_>) -> impl Iterator<Item = Stream> {
        self.streams().filter(|stream| stream.is_reported_in(state))
    }
}

impl Stream {
    /// Whether there is something to report.
    pub(in crate::mavlink) fn is_reported_in(self, state: &SystemState<'_>) -> bool {
        let Some(pack) = self.pack() else { return true };
        let battery = state.battery(pack);
        state.is_reported(pack)
            && match self.kind().subject() {
                Subject::Vehicle | Subject::EachPack => true,
                Subject::EachTank => state.is_tank(pack),
                Subject::EachKnownResistance => battery.resistance_ohm.is_some(),
                Subject::EachKnownRestingVoltage => battery.readings.resting_voltage_v.is_some(),
                Subject::EachKnownDeviation => battery.readings.remaining_sigma_pct.is_some(),
                Subject::EachKnownUsableCharge => battery.readings.usable_pct.is_some(),
            }
    }
}

/// The next message of a link.
///
/// Bytes of files are no [`Message`]: of these many wait, and the longest decides how much memory each takes.
#[derive(Clone, Debug, PartialEq)]
pub enum Outgoing {
    /// A message.
    Message(Message),
    /// An answer of MAVLink FTP with bytes of a file.
    FileData(FileData),
}

/// A message that becomes a frame.
pub trait ToFrame {
    /// The system id that sends it, if that is not the vehicle's at present.
    fn sender_system(&self) -> Option<u8>;

    /// Writes it as a MAVLink 2 frame into `frame`.
    fn serialize(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw);
}

impl ToFrame for Message {
    fn sender_system(&self) -> Option<u8> {
        match self {
            Self::FileAnswer(answer) => Some(answer.header.sender_system),
            _ => None,
        }
    }

    fn serialize(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw) {
        self.write(header, frame);
    }
}

impl ToFrame for Outgoing {
    fn sender_system(&self) -> Option<u8> {
        match self {
            Self::Message(message) => message.sender_system(),
            Self::FileData(data) => Some(data.header.sender_system),
        }
    }

    fn serialize(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw) {
        match self {
            Self::Message(message) => message.write(header, frame),
            Self::FileData(data) => frame.serialize_message_data(header, data),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stream_leads_back_to_its_row() {
        for kind in StreamKind::ALL {
            assert!(StreamKind::with_message_id(kind.message_id()).any(|other| other == kind));
            assert!(kind.streams().all(|stream| stream.kind() == kind), "{kind:?}");
        }
        assert_eq!(StreamKind::with_message_id(30).next(), None);
    }
}
