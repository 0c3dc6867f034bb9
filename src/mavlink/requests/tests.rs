//! Each field against the serialiser of the dialect.

use std::vec::Vec;

use ::mavlink::MavlinkVersion;

use super::*;
use crate::mavlink::dialect::{
    MavCmd, MavDataStream, MavModeFlag, MavType, WifiConfigApMode, WifiConfigApResponse,
};

const VEHICLE: Peer = Peer {
    system_id: 7,
    component_id: 9,
};

/// What is decoded of a message.
fn decoded<T: MessageData>(message: &T) -> (Target, Request<'static>) {
    let mut bytes = [0; 255];
    let length = message.ser(MavlinkVersion::V2, &mut bytes);
    let payload = Payload(bytes[..length].to_vec().leak());
    decode(T::ID, &payload).expect("it is a request")
}

#[test]
fn what_concerns_the_vehicle_and_the_link_is_decoded() {
    let heartbeat = HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GCS,
        ..HEARTBEAT_DATA::DEFAULT
    };
    let request = Request::Heartbeat { system_type: 6 };
    assert_eq!(decoded(&heartbeat), (Target::Everyone, request));

    let set_mode = SET_MODE_DATA {
        custom_mode: 0x0102_0304,
        target_system: 7,
        base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
    };
    let request = Request::SetMode {
        custom_mode: 0x0102_0304,
        base_mode: 1,
    };
    assert_eq!(decoded(&set_mode), (Target::System(7), request));

    let status = RADIO_STATUS_DATA {
        txbuf: 42,
        ..RADIO_STATUS_DATA::DEFAULT
    };
    let request = Request::RadioStatus { free_percent: 42 };
    assert_eq!(decoded(&status), (Target::Everyone, request));

    for (start_stop, rate_hz) in [(1, Some(258)), (0, None)] {
        let stream = REQUEST_DATA_STREAM_DATA {
            req_message_rate: 258,
            target_system: 7,
            target_component: 9,
            req_stream_id: MavDataStream::MAV_DATA_STREAM_EXTRA1,
            start_stop,
        };
        let request = Request::DataStream {
            stream_id: 10,
            rate_hz,
        };
        assert_eq!(decoded(&stream), (Target::Component(VEHICLE), request));
    }
}

#[test]
fn parameters_are_decoded() {
    let list = PARAM_REQUEST_LIST_DATA {
        target_system: 7,
        target_component: 9,
    };
    assert_eq!(
        decoded(&list),
        (Target::Component(VEHICLE), Request::ParameterList)
    );

    let name = Name::from("SIXTEEN_LETTERS_");
    let read = PARAM_REQUEST_READ_DATA {
        param_index: -2,
        target_system: 7,
        target_component: 9,
        param_id: name.0.into(),
    };
    let request = Request::ParameterRead { index: -2, name };
    assert_eq!(decoded(&read), (Target::Component(VEHICLE), request));

    let set = PARAM_SET_DATA {
        param_value: 1.5,
        target_system: 7,
        target_component: 9,
        param_id: name.0.into(),
        ..PARAM_SET_DATA::DEFAULT
    };
    let request = Request::ParameterSet { name, value: 1.5 };
    assert_eq!(decoded(&set), (Target::Component(VEHICLE), request));
}

#[test]
fn commands_are_decoded_alike_from_either_message() {
    let command = Request::Command(Command {
        number: 246,
        param1: 1.5,
        param2: -2.5,
        param3: 3.5,
        param4: -4.5,
    });
    let long = COMMAND_LONG_DATA {
        param1: 1.5,
        param2: -2.5,
        param3: 3.5,
        param4: -4.5,
        command: MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
        target_system: 7,
        target_component: 9,
        ..COMMAND_LONG_DATA::DEFAULT
    };
    assert_eq!(decoded(&long), (Target::Component(VEHICLE), command.clone()));
    let int = COMMAND_INT_DATA {
        param1: 1.5,
        param2: -2.5,
        param3: 3.5,
        param4: -4.5,
        command: MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
        target_system: 7,
        target_component: 9,
        ..COMMAND_INT_DATA::DEFAULT
    };
    assert_eq!(decoded(&int), (Target::Component(VEHICLE), command));
}

#[test]
fn axes_are_levers() {
    for (y, z, steering, throttle) in [
        (-300, 700, StickInput::Position(-300), StickInput::Position(700)),
        (i16::MAX, 0, StickInput::Released, StickInput::Position(0)),
    ] {
        let control = MANUAL_CONTROL_DATA {
            x: 1,
            y,
            z,
            r: 2,
            target: 7,
            ..MANUAL_CONTROL_DATA::DEFAULT
        };
        let request = Request::Control { throttle, steering };
        assert_eq!(decoded(&control), (Target::OnlySystem(7), request));
    }
}

#[test]
fn channels_are_pulses() {
    let channels = RC_CHANNELS_OVERRIDE_DATA {
        chan1_raw: 1400,
        chan2_raw: 0,
        chan3_raw: 1700,
        chan4_raw: u16::MAX,
        chan5_raw: 5,
        chan6_raw: 6,
        chan7_raw: 7,
        chan8_raw: 8,
        target_system: 7,
        target_component: 9,
        ..RC_CHANNELS_OVERRIDE_DATA::DEFAULT
    };
    let request = Request::ChannelOverride([1400, 0, 1700, u16::MAX, 5, 6, 7, 8]);
    assert_eq!(decoded(&channels), (Target::OnlyComponent(VEHICLE), request));
}

#[test]
fn times_are_decoded() {
    let ping = PING_DATA {
        time_usec: 0x0102_0304_0506_0708,
        seq: 0x090A_0B0C,
        target_system: 7,
        target_component: 9,
    };
    let request = Request::Ping {
        time_us: 0x0102_0304_0506_0708,
        sequence: 0x090A_0B0C,
        target: VEHICLE,
    };
    assert_eq!(decoded(&ping), (Target::Component(VEHICLE), request));

    let timesync = TIMESYNC_DATA {
        tc1: 0x0102_0304_0506_0708,
        ts1: -1,
        target_system: 7,
        target_component: 9,
    };
    let request = Request::Timesync {
        answered_ns: 0x0102_0304_0506_0708,
        asked_ns: -1,
    };
    assert_eq!(decoded(&timesync), (Target::Component(VEHICLE), request));

    let system_time = SYSTEM_TIME_DATA {
        time_unix_usec: 0x0102_0304_0506_0708,
        time_boot_ms: 0x090A_0B0C,
    };
    let request = Request::SystemTime {
        unix_us: 0x0102_0304_0506_0708,
        boot_ms: 0x090A_0B0C,
    };
    assert_eq!(decoded(&system_time), (Target::Everyone, request));
}

#[test]
fn file_transfers_are_decoded() {
    let mut payload = [0; 251];
    payload[..5].copy_from_slice(&[0x01, 0x02, 3, 4, 5]);
    payload[8..12].copy_from_slice(&[6, 7, 8, 9]);
    payload[12..18].copy_from_slice(b"abc\0ef");
    let transfer = FILE_TRANSFER_PROTOCOL_DATA {
        target_network: 1,
        target_system: 7,
        target_component: 9,
        payload,
    };
    let (target, request) = decoded(&transfer);
    assert_eq!(target, Target::Component(VEHICLE));
    let Request::FileTransfer(request) = request else {
        panic!("{request:?}");
    };
    assert_eq!((request.sequence, request.session), (0x0201, 3));
    assert_eq!(
        (request.opcode, request.size, request.offset),
        (4, 5, 0x0908_0706)
    );
    // Zeros at the end are not on the wire.
    assert_eq!(request.data().collect::<Vec<_>>(), b"abc\0e");
    let longest = FileTransfer { size: 239, ..request };
    assert_eq!(longest.data().count(), 239);
}

#[test]
fn log_requests_are_decoded() {
    let list = LOG_REQUEST_LIST_DATA {
        start: 258,
        end: 772,
        target_system: 7,
        target_component: 9,
    };
    let request = Request::LogList(LogListRequest { start: 258, end: 772 });
    assert_eq!(decoded(&list), (Target::Component(VEHICLE), request));
    let data = LOG_REQUEST_DATA_DATA {
        ofs: 0x0102_0304,
        count: 0x0506_0708,
        id: 258,
        target_system: 7,
        target_component: 9,
    };
    let request = Request::LogData(LogDataRequest {
        id: 258,
        offset: 0x0102_0304,
        bytes: 0x0506_0708,
    });
    assert_eq!(decoded(&data), (Target::Component(VEHICLE), request));
    let erase = LOG_ERASE_DATA {
        target_system: 7,
        target_component: 9,
    };
    assert_eq!(decoded(&erase), (Target::Component(VEHICLE), Request::LogErase));
    let end = LOG_REQUEST_END_DATA {
        target_system: 7,
        target_component: 9,
    };
    assert_eq!(decoded(&end), (Target::Component(VEHICLE), Request::LogEnd));
}

#[test]
fn a_key_of_zeros_is_none_and_a_time_beyond_48_bits_is_invalid() {
    for (secret_key, initial_timestamp, key, time) in [
        ([5; 32], 9, SigningKey::new([5; 32]), Timestamp::from_ticks(9)),
        ([0; 32], 1 << 48, None, None),
    ] {
        let setup = SETUP_SIGNING_DATA {
            initial_timestamp,
            target_system: 7,
            target_component: 9,
            secret_key,
        };
        let request = Request::SetUpSigning(SetUpSigning { key, time });
        assert_eq!(decoded(&setup), (Target::OnlySystem(7), request));
    }
}

#[test]
fn zero_is_every_system_and_component_but_for_control_inputs_and_keys() {
    let component = |system_id, component_id| Peer {
        system_id,
        component_id,
    };
    for (target, is_ours) in [
        (Target::Everyone, true),
        (Target::System(7), true),
        (Target::System(0), true),
        (Target::System(8), false),
        (Target::OnlySystem(7), true),
        (Target::OnlySystem(0), false),
        (Target::Component(component(7, COMPONENT_ID)), true),
        (Target::Component(component(0, 0)), true),
        (Target::Component(component(8, 0)), false),
        (Target::Component(component(7, 2)), false),
        (Target::OnlyComponent(component(7, 0)), true),
        (Target::OnlyComponent(component(0, 0)), false),
        (Target::OnlyComponent(component(7, 2)), false),
    ] {
        assert_eq!(target.is_ours(7), is_ours, "{target:?}");
    }
}

#[test]
fn a_message_nothing_here_answers_is_no_request() {
    assert_eq!(decode(30, &Payload(&[1; 28])), None);
}

#[test]
fn wifi_is_set_up_by_a_request_and_not_by_an_answer() {
    let mut config = WIFI_CONFIG_AP_DATA {
        ssid: (*b"0123456789abcdef0123456789abcdef").into(),
        password: [b'p'; 64].into(),
        mode: WifiConfigApMode::WIFI_CONFIG_AP_MODE_DISABLED,
        ..WIFI_CONFIG_AP_DATA::DEFAULT
    };
    let (target, request) = decoded(&config);
    assert_eq!(target, Target::Everyone);
    let Request::WifiConfig(request) = request else {
        panic!("{request:?}");
    };
    assert_eq!(request.mode, 3);
    assert_eq!(request.ssid(), b"0123456789abcdef0123456789abcdef");
    assert_eq!(request.password(), [b'p'; 64]);

    config.response = WifiConfigApResponse::WIFI_CONFIG_AP_RESPONSE_ACCEPTED;
    let mut bytes = [0; 255];
    let length = config.ser(MavlinkVersion::V2, &mut bytes);
    assert_eq!(decode(WIFI_CONFIG_AP_DATA::ID, &Payload(&bytes[..length])), None);
}
