//! What the page in the browser knows of MAVLink's messages: `web/messages.js`, from the definitions that the firmware
//! has.
#![allow(deprecated, reason = "the page measures the round trip by PING")]

use ::mavlink::types::CharArray;
use ::mavlink::{MavlinkVersion, MessageData};
use rover_battmon::mavlink::dialect::{
    AUTOPILOT_VERSION_DATA, BATTERY_INFO_DATA, BATTERY_STATUS_DATA, COMMAND_ACK_DATA, COMMAND_LONG_DATA,
    FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA, LOG_DATA_DATA, LOG_ENTRY_DATA, LOG_ERASE_DATA,
    LOG_REQUEST_DATA_DATA, LOG_REQUEST_END_DATA, LOG_REQUEST_LIST_DATA, MANUAL_CONTROL_DATA, MavAutopilot,
    MavBatteryChargeState, MavBatteryType, MavCmd, MavModeFlag, MavParamError, MavParamType, MavResult,
    MavSeverity, MavState, MavSysStatusSensor, MavType, NAMED_VALUE_FLOAT_DATA, PARAM_ERROR_DATA,
    PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA, PING_DATA,
    STATUSTEXT_DATA, SYS_STATUS_DATA, SYSTEM_TIME_DATA,
};

/// More than any of the messages has.
const MAX_PAYLOAD_BYTES: usize = 255;

const HEAD: &str = "\
// Written by `cargo run --example page_messages`: name, id and CRC_EXTRA of each message, then the fields that the page
// uses, each with its type (as of Python's struct, s is text), its place, and how many if it is an array.
const MESSAGE_TABLE = `
";

/// A type that a field has on the wire.
trait Field {
    /// Its letter in the table, and behind an x how many there are if it is an array.
    const CODE: (&'static str, &'static str);

    /// A value whose first byte on the wire is not that of the default.
    fn marked() -> Self;
}

macro_rules! fields {
    ($($kind:ty: $letter:literal $count:literal, $marked:expr;)+) => {
        $(impl Field for $kind {
            const CODE: (&'static str, &'static str) = ($letter, $count);

            fn marked() -> Self {
                $marked
            }
        })+
    };
}

fields! {
    u8: "B" "", 1;
    i8: "b" "", 1;
    u16: "H" "", 1;
    i16: "h" "", 1;
    u32: "I" "", 1;
    i32: "i" "", 1;
    u64: "Q" "", 1;
    f32: "f" "", f32::from_bits(1);
    [u8; 8]: "s" "x8", [1; 8];
    [u8; 90]: "B" "x90", [1; 90];
    [u8; 251]: "B" "x251", [1; 251];
    [u16; 4]: "H" "x4", [1; 4];
    [u16; 10]: "H" "x10", [1; 10];
    CharArray<10>: "s" "x10", CharArray::from([1; 10]);
    CharArray<16>: "s" "x16", CharArray::from([1; 16]);
    CharArray<50>: "s" "x50", CharArray::from([1; 50]);
    MavAutopilot: "B" "", Self::MAV_AUTOPILOT_RESERVED;
    MavBatteryChargeState: "B" "", Self::MAV_BATTERY_CHARGE_STATE_OK;
    MavBatteryType: "B" "", Self::MAV_BATTERY_TYPE_LIPO;
    MavCmd: "H" "", Self::MAV_CMD_COMPONENT_ARM_DISARM;
    MavModeFlag: "B" "", Self::from_bits_retain(2);
    MavParamError: "B" "", Self::MAV_PARAM_ERROR_DOES_NOT_EXIST;
    MavParamType: "B" "", Self::MAV_PARAM_TYPE_INT8;
    MavResult: "B" "", Self::MAV_RESULT_DENIED;
    MavSeverity: "B" "", Self::MAV_SEVERITY_ALERT;
    MavState: "B" "", Self::MAV_STATE_BOOT;
    MavSysStatusSensor: "I" "", Self::from_bits_retain(2);
    MavType: "B" "", Self::MAV_TYPE_FIXED_WING;
}

/// Offset at which `marked` differs on the wire.
fn place<M: MessageData>(unmarked: &M, marked: &M) -> usize {
    let bytes = |message: &M| {
        let mut payload = [0; MAX_PAYLOAD_BYTES];
        message.ser(MavlinkVersion::V2, &mut payload);
        payload
    };
    let (unmarked, marked) = (bytes(unmarked), bytes(marked));
    let differs = unmarked.iter().zip(&marked).position(|(one, other)| one != other);
    differs.expect("a marked field differs")
}

/// The code of the field that these set.
fn code<M, T: Field>(_set: fn(&mut M, T)) -> (&'static str, &'static str) {
    T::CODE
}

fn mark<M, T: Field>(message: &mut M, set: fn(&mut M, T)) {
    set(message, T::marked());
}

macro_rules! rows {
    ($($message:ident { $($field:ident)* })+) => {
        [$({
            let mut row = format!("{} {} {}", $message::NAME, $message::ID, $message::EXTRA_CRC);
            $({
                let set: fn(&mut $message, _) = |message, value| message.$field = value;
                let mut marked = $message::DEFAULT;
                mark(&mut marked, set);
                let place = place(&$message::DEFAULT, &marked);
                let (letter, count) = code(set);
                // `type` is no name of a field in Rust.
                let name = stringify!($field).replace("mavtype", "type");
                row += &format!(" {name}:{letter}{place}{count}");
            })*
            row
        }),+]
    };
}

/// The text of `web/messages.js`.
pub fn messages_js() -> String {
    let rows = rows! {
        HEARTBEAT_DATA { custom_mode mavtype autopilot base_mode system_status mavlink_version }
        SYS_STATUS_DATA { onboard_control_sensors_health errors_comm }
        SYSTEM_TIME_DATA { time_unix_usec time_boot_ms }
        PING_DATA { seq }
        PARAM_REQUEST_READ_DATA { param_index target_system param_id }
        PARAM_REQUEST_LIST_DATA { target_system }
        PARAM_VALUE_DATA { param_value param_count param_index param_id param_type }
        PARAM_SET_DATA { param_value target_system param_id param_type }
        MANUAL_CONTROL_DATA { y z target }
        COMMAND_LONG_DATA { param1 param2 command target_system }
        COMMAND_ACK_DATA { command result }
        FILE_TRANSFER_PROTOCOL_DATA { target_system payload }
        LOG_REQUEST_LIST_DATA { end target_system }
        LOG_ENTRY_DATA { time_utc size id num_logs }
        LOG_REQUEST_DATA_DATA { ofs count id target_system }
        LOG_DATA_DATA { ofs id count data }
        LOG_ERASE_DATA { target_system }
        LOG_REQUEST_END_DATA { target_system }
        BATTERY_STATUS_DATA {
            current_consumed temperature voltages current_battery id battery_remaining time_remaining charge_state
            voltages_ext
        }
        AUTOPILOT_VERSION_DATA { uid middleware_sw_version flight_custom_version }
        NAMED_VALUE_FLOAT_DATA { value name }
        STATUSTEXT_DATA { severity text id chunk_seq }
        PARAM_ERROR_DATA { param_id error }
        BATTERY_INFO_DATA { design_capacity full_charge_capacity id mavtype state_of_health cells_in_series }
    };
    format!("{HEAD}{}\n`;\n", rows.join("\n"))
}
