//! What a ground station sends, as frames.

use super::commands::{ARM_DISARM, FORCED, PREFLIGHT_REBOOT_SHUTDOWN};
use super::frames::{
    COMMAND_INT, COMMAND_LONG, FILE_TRANSFER_PROTOCOL, GROUND_STATION, HEARTBEAT, LOG_ERASE,
    LOG_REQUEST_DATA, LOG_REQUEST_LIST, MANUAL_CONTROL, PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET,
    PING, RADIO_STATUS, RC_CHANNELS_OVERRIDE, REQUEST_DATA_STREAM, SET_MODE, SETUP_SIGNING, SYSTEM_TIME,
    TIMESYNC, WIFI_CONFIG_AP, encode_v2, encode_v2_from,
};

/// The vehicle's system and component id.
pub const VEHICLE: [u8; 2] = [1, 1];
pub const EVERYONE: [u8; 2] = [0, 0];

/// The vehicle's system id, for messages that name no component.
pub const VEHICLE_ID: u8 = VEHICLE[0];

/// The flag of SET_MODE, and the mode that follows stick input.
pub const CUSTOM_MODE_ENABLED: u8 = 1;
pub const MANUAL: u32 = 0;

/// Kinds of systems, in heartbeats.
pub const GCS: u8 = 6;
pub const ONBOARD_CONTROLLER: u8 = 18;

/// System and component id of a SiK radio: "3D", the component being `MAV_COMP_ID_TELEMETRY_RADIO`.
pub const SIK_RADIO: [u8; 2] = [51, 68];

const REAL32: u8 = 9;

fn name(text: &str) -> [u8; 16] {
    let mut name = [0; 16];
    name[..text.len()].copy_from_slice(text.as_bytes());
    name
}

pub fn param_request_list(target: [u8; 2]) -> Vec<u8> {
    encode_v2(PARAM_REQUEST_LIST, &target)
}

pub fn param_read_by_name(text: &str) -> Vec<u8> {
    param_read_from(VEHICLE, text)
}

pub fn param_read_from(target: [u8; 2], text: &str) -> Vec<u8> {
    param_read(target, -1, text)
}

pub fn param_read_by_index(index: i16) -> Vec<u8> {
    param_read(VEHICLE, index, "")
}

fn param_read(target: [u8; 2], index: i16, text: &str) -> Vec<u8> {
    let payload = [&index.to_le_bytes()[..], &target, &name(text)];
    encode_v2(PARAM_REQUEST_READ, &payload.concat())
}

/// As MAVProxy sends it: the type is always REAL32.
pub fn param_set(text: &str, value: f32) -> Vec<u8> {
    param_set_to(VEHICLE, text, value)
}

pub fn param_set_to(target: [u8; 2], text: &str, value: f32) -> Vec<u8> {
    encode_v2(PARAM_SET, &param_set_payload(target, text, value))
}

pub fn param_set_payload(target: [u8; 2], text: &str, value: f32) -> Vec<u8> {
    [&value.to_le_bytes()[..], &target, &name(text), &[REAL32]].concat()
}

/// The parameters a command does not use are NaN from some ground stations.
pub fn command_long(number: u16, param1: f32) -> Vec<u8> {
    command_long_2(number, param1, f32::NAN)
}

pub fn command_long_2(number: u16, param1: f32, param2: f32) -> Vec<u8> {
    command_long_4(number, [param1, param2, f32::NAN, f32::NAN])
}

pub fn command_long_4(number: u16, parameters: [f32; 4]) -> Vec<u8> {
    let parameters = [&parameters[..], &[f32::NAN; 3]].concat();
    let mut payload: Vec<u8> = parameters.into_iter().flat_map(f32::to_le_bytes).collect();
    payload.extend(number.to_le_bytes());
    payload.extend(VEHICLE);
    encode_v2(COMMAND_LONG, &payload)
}

pub fn command_int(number: u16, param1: f32) -> Vec<u8> {
    command_int_2(number, param1, 0.0)
}

pub fn command_int_2(number: u16, param1: f32, param2: f32) -> Vec<u8> {
    let [param1, param2] = [param1, param2].map(f32::to_le_bytes);
    let payload = [&param1[..], &param2, &[0; 20], &number.to_le_bytes(), &VEHICLE];
    encode_v2(COMMAND_INT, &payload.concat())
}

/// MAVLink FTP: open a file for reading.
pub fn ftp_open(sequence: u16, path: &str) -> Vec<u8> {
    const OPEN_FILE_READ_ONLY: u8 = 4;
    let length = path.len() as u8;
    ftp(sequence, OPEN_FILE_READ_ONLY, length, 0, path.as_bytes())
}

/// A request of MAVLink FTP, of session 0.
pub fn ftp(sequence: u16, opcode: u8, size: u8, offset: u32, data: &[u8]) -> Vec<u8> {
    let mut payload = vec![0, VEHICLE[0], VEHICLE[1]];
    payload.extend(sequence.to_le_bytes());
    payload.extend([0, opcode, size, 0, 0, 0]);
    payload.extend(offset.to_le_bytes());
    payload.extend(data);
    encode_v2(FILE_TRANSFER_PROTOCOL, &payload)
}

/// All log files, or those with an id from `start` to `end`.
pub fn log_list(start: u16, end: u16) -> Vec<u8> {
    let payload = [&start.to_le_bytes()[..], &end.to_le_bytes(), &VEHICLE];
    encode_v2(LOG_REQUEST_LIST, &payload.concat())
}

pub fn log_erase() -> Vec<u8> {
    encode_v2(LOG_ERASE, &VEHICLE)
}

/// This many bytes of a log file from an offset on.
pub fn log_data(id: u16, offset: u32, bytes: u32) -> Vec<u8> {
    let [offset, bytes] = [offset, bytes].map(u32::to_le_bytes);
    let payload = [&offset[..], &bytes, &id.to_le_bytes(), &VEHICLE];
    encode_v2(LOG_REQUEST_DATA, &payload.concat())
}

pub fn request_data_stream(stream: u8, rate_hz: u16, start_stop: u8) -> Vec<u8> {
    let payload = [&rate_hz.to_le_bytes()[..], &VEHICLE, &[stream, start_stop]];
    encode_v2(REQUEST_DATA_STREAM, &payload.concat())
}

pub fn ping(time_us: u64, sequence: u32) -> Vec<u8> {
    let payload = [&time_us.to_le_bytes()[..], &sequence.to_le_bytes(), &EVERYONE];
    encode_v2(PING, &payload.concat())
}

/// A request for the time: no time of its own, and a time stamp to recognise the answer by.
pub fn timesync(stamp: i64) -> Vec<u8> {
    encode_v2(TIMESYNC, &[&[0; 8][..], &stamp.to_le_bytes()].concat())
}

/// What time it is, in µs since 1970.
pub fn system_time(unix_us: u64) -> Vec<u8> {
    system_time_from(GROUND_STATION, unix_us)
}

pub fn system_time_from(sender: [u8; 2], unix_us: u64) -> Vec<u8> {
    let payload = [&unix_us.to_le_bytes()[..], &[0; 4]];
    encode_v2_from(sender, SYSTEM_TIME, &payload.concat())
}

/// A station states its time since its own start, in ms.
pub fn stated_time(boot_ms: u32) -> Vec<u8> {
    stated_times(boot_ms, 0)
}

/// A station states its time since its own start, in ms, and what time it is, in µs since 1970.
pub fn stated_times(boot_ms: u32, unix_us: u64) -> Vec<u8> {
    encode_v2(
        SYSTEM_TIME,
        &[&unix_us.to_le_bytes()[..], &boot_ms.to_le_bytes()].concat(),
    )
}

/// A SiK radio reports how much of its transmit buffer is free, in percent.
pub fn radio_status(buffer_free: u8) -> Vec<u8> {
    radio_status_from(SIK_RADIO, buffer_free)
}

/// Such a report by another sender.
pub fn radio_status_from(sender: [u8; 2], buffer_free: u8) -> Vec<u8> {
    let payload = [0, 0, 0, 0, 180, 170, buffer_free, 20, 20];
    encode_v2_from(sender, RADIO_STATUS, &payload)
}

pub fn reboot() -> Vec<u8> {
    command_long(PREFLIGHT_REBOOT_SHUTDOWN, 1.0)
}

/// Provokes a processor fault.
pub fn provoke_fault() -> Vec<u8> {
    command_long_4(PREFLIGHT_REBOOT_SHUTDOWN, [42.0, 24.0, 71.0, 94.0])
}

pub fn reboot_to_boot_loader() -> Vec<u8> {
    command_long(PREFLIGHT_REBOOT_SHUTDOWN, 3.0)
}

/// Arms, with all checks.
pub fn arm() -> Vec<u8> {
    command_long(ARM_DISARM, 1.0)
}

/// Arms, without checks.
pub fn arm_by_force() -> Vec<u8> {
    command_long_2(ARM_DISARM, 1.0, FORCED)
}

pub fn disarm() -> Vec<u8> {
    command_long(ARM_DISARM, 0.0)
}

pub fn disarm_by_force() -> Vec<u8> {
    command_long_2(ARM_DISARM, 0.0, FORCED)
}

/// MAV_CMD_DO_SET_MODE, in ArduPilot's own numbers.
pub fn do_set_mode(mode: f32) -> Vec<u8> {
    command_long_2(176, 1.0, mode)
}

pub fn set_mode(target: u8, base_mode: u8, mode: u32) -> Vec<u8> {
    let payload = [&mode.to_le_bytes()[..], &[target, base_mode]];
    encode_v2(SET_MODE, &payload.concat())
}

/// The mode that follows stick input.
pub fn manual_mode() -> Vec<u8> {
    set_mode(VEHICLE_ID, CUSTOM_MODE_ENABLED, MANUAL)
}

/// The axes x and r are full of what must not matter.
pub fn manual_control(target: u8, steering: i16, throttle: i16) -> Vec<u8> {
    let axes = [777, steering, throttle, -777].map(i16::to_le_bytes);
    encode_v2(MANUAL_CONTROL, &[&axes.concat()[..], &[0, 0, target]].concat())
}

/// The channels but 1 and 3 are full of what must not matter.
pub fn rc_override(target: [u8; 2], steering_us: u16, throttle_us: u16) -> Vec<u8> {
    let channels = [steering_us, 1234, throttle_us, 1111, 1999, 0, 65535, 1500].map(u16::to_le_bytes);
    encode_v2(RC_CHANNELS_OVERRIDE, &[&channels.concat()[..], &target].concat())
}

/// The heartbeat of a ground station, or of another kind of system.
pub fn heartbeat(kind: u8) -> Vec<u8> {
    heartbeat_from(GROUND_STATION, kind)
}

pub fn heartbeat_from(sender: [u8; 2], kind: u8) -> Vec<u8> {
    encode_v2_from(sender, HEARTBEAT, &[0, 0, 0, 0, kind, 8, 0, 4, 3])
}

pub fn setup_signing(key: [u8; 32], initial_timestamp: u64) -> Vec<u8> {
    setup_signing_of(VEHICLE, key, initial_timestamp)
}

pub fn setup_signing_of(target: [u8; 2], key: [u8; 32], initial_timestamp: u64) -> Vec<u8> {
    let payload = [&initial_timestamp.to_le_bytes()[..], &target, &key];
    encode_v2(SETUP_SIGNING, &payload.concat())
}

pub fn wifi_config(ssid: &str, password: &str, mode: u8) -> Vec<u8> {
    encode_v2(WIFI_CONFIG_AP, &wifi_config_payload(ssid, password, mode))
}

/// With the response of a request, which does not exist.
pub fn wifi_config_payload(ssid: &str, password: &str, mode: u8) -> Vec<u8> {
    let mut payload = vec![0; 98];
    payload[..ssid.len()].copy_from_slice(ssid.as_bytes());
    payload[32..32 + password.len()].copy_from_slice(password.as_bytes());
    payload[96] = mode;
    payload
}
