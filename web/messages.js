// Written by `cargo run --example page_messages`: name, id, CRC_EXTRA and length of each message, then the fields that
// the page uses, each with its type (as of Python's struct, s is text), its place, and how many if it is an array.
const MESSAGE_TABLE = `
HEARTBEAT 0 50 9 custom_mode:I0 type:B4 autopilot:B5 base_mode:B6 system_status:B7 mavlink_version:B8
SYS_STATUS 1 124 43 onboard_control_sensors_health:I8 errors_comm:H20
PARAM_REQUEST_READ 20 214 20 param_index:h0 target_system:B2 target_component:B3 param_id:s4x16
PARAM_REQUEST_LIST 21 159 2 target_system:B0 target_component:B1
PARAM_VALUE 22 220 25 param_value:f0 param_count:H4 param_index:H6 param_id:s8x16 param_type:B24
PARAM_SET 23 168 23 param_value:f0 target_system:B4 target_component:B5 param_id:s6x16 param_type:B22
MANUAL_CONTROL 69 243 30 y:h2 z:h4 target:B10
COMMAND_LONG 76 152 33 param1:f0 param2:f4 command:H28 target_system:B30 target_component:B31 confirmation:B32
COMMAND_ACK 77 143 10 command:H0 result:B2
LOG_REQUEST_LIST 117 128 6 end:H2 target_system:B4 target_component:B5
LOG_ENTRY 118 56 14 time_utc:I0 size:I4 id:H8 num_logs:H10
LOG_REQUEST_DATA 119 116 12 ofs:I0 count:I4 id:H8 target_system:B10 target_component:B11
LOG_DATA 120 134 97 ofs:I0 id:H4 data:B7x90
LOG_ERASE 121 237 2 target_system:B0 target_component:B1
LOG_REQUEST_END 122 203 2 target_system:B0 target_component:B1
BATTERY_STATUS 147 154 54 current_consumed:i0 temperature:h8 voltages:H10x10 current_battery:h30 id:B32 battery_remaining:b35 time_remaining:i36 charge_state:B40 voltages_ext:H41x4
AUTOPILOT_VERSION 148 178 78 uid:Q8 middleware_sw_version:I20 flight_custom_version:s36x8
STATUSTEXT 253 83 54 severity:B0 text:s1x50 id:H51 chunk_seq:B53
PARAM_ERROR 345 209 21 param_id:s4x16 error:B20
BATTERY_INFO 372 26 140 id:B44 cells_in_series:B48
`;
