// Written by `cargo run --example page_messages`: name, id and CRC_EXTRA of each message, then the fields that the page
// uses, each with its type (as of Python's struct, s is text), its place, and how many if it is an array.
const MESSAGE_TABLE = `
HEARTBEAT 0 50 custom_mode:I0 type:B4 autopilot:B5 base_mode:B6 system_status:B7 mavlink_version:B8
SYS_STATUS 1 124 onboard_control_sensors_health:I8 errors_comm:H20
SYSTEM_TIME 2 137 time_unix_usec:Q0 time_boot_ms:I8
PING 4 237 seq:I8
PARAM_REQUEST_READ 20 214 param_index:h0 target_system:B2 param_id:s4x16
PARAM_REQUEST_LIST 21 159 target_system:B0
PARAM_VALUE 22 220 param_value:f0 param_count:H4 param_index:H6 param_id:s8x16 param_type:B24
PARAM_SET 23 168 param_value:f0 target_system:B4 param_id:s6x16 param_type:B22
MANUAL_CONTROL 69 243 y:h2 z:h4 target:B10
COMMAND_LONG 76 152 param1:f0 param2:f4 command:H28 target_system:B30
COMMAND_ACK 77 143 command:H0 result:B2
FILE_TRANSFER_PROTOCOL 110 84 target_system:B1 payload:B3x251
LOG_REQUEST_LIST 117 128 end:H2 target_system:B4
LOG_ENTRY 118 56 time_utc:I0 size:I4 id:H8 num_logs:H10
LOG_REQUEST_DATA 119 116 ofs:I0 count:I4 id:H8 target_system:B10
LOG_DATA 120 134 ofs:I0 id:H4 count:B6 data:B7x90
LOG_ERASE 121 237 target_system:B0
LOG_REQUEST_END 122 203 target_system:B0
BATTERY_STATUS 147 154 current_consumed:i0 temperature:h8 voltages:H10x10 current_battery:h30 id:B32 battery_remaining:b35 time_remaining:i36 charge_state:B40 voltages_ext:H41x4
AUTOPILOT_VERSION 148 178 uid:Q8 middleware_sw_version:I20 flight_custom_version:s36x8
NAMED_VALUE_FLOAT 251 170 value:f4 name:s8x10
STATUSTEXT 253 83 severity:B0 text:s1x50 id:H51 chunk_seq:B53
PARAM_ERROR 345 209 param_id:s4x16 error:B20
BATTERY_INFO 372 26 design_capacity:f32 full_charge_capacity:f36 id:B44 type:B46 state_of_health:B47 cells_in_series:B48
`;
