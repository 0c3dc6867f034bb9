//! Everything a ground station can send, well formed or not: no value leaves its range, nothing moves that is not armed,
//! and the next question is answered.

use rover_battmon::battery::BatteryState;
use rover_battmon::parameter::{ParameterId, Refused};
use rover_battmon::vehicle::{ArmState, SideDrives};

use super::Input;
use crate::desk::Desk;
use crate::frames::{
    COMMAND_INT, COMMAND_LONG, FILE_TRANSFER_PROTOCOL, GROUND_STATION, HEARTBEAT, MANUAL_CONTROL,
    PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET, PARAM_VALUE, PING, RADIO_STATUS, RC_CHANNELS_OVERRIDE,
    REQUEST_DATA_STREAM, SET_MODE, SETUP_SIGNING, SYSTEM_TIME, TIMESYNC, encode_v2_from, of_message,
};
use crate::requests::{SIK_RADIO, param_read_from};

/// The messages that have an effect.
const MESSAGES: [u32; 16] = [
    HEARTBEAT,
    PING,
    SET_MODE,
    PARAM_REQUEST_READ,
    PARAM_REQUEST_LIST,
    PARAM_SET,
    REQUEST_DATA_STREAM,
    MANUAL_CONTROL,
    RC_CHANNELS_OVERRIDE,
    COMMAND_INT,
    COMMAND_LONG,
    RADIO_STATUS,
    FILE_TRANSFER_PROTOCOL,
    TIMESYNC,
    SETUP_SIGNING,
    SYSTEM_TIME,
];

const LONGEST_PAYLOAD: usize = 255;

/// Steps: a byte says what happens, the next ones how.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let mut desk = Desk::with_packs(&[BatteryState::default(); 9]);
    while !input.is_empty() {
        match input.byte() {
            step @ 0..=0x7F => {
                let message_id = MESSAGES[usize::from(step) % MESSAGES.len()];
                let length = usize::from(input.byte());
                let mut payload = input.bytes(length.min(LONGEST_PAYLOAD)).to_vec();
                payload.resize(payload.len().max(1), 0);
                let sender = match message_id {
                    RADIO_STATUS => SIK_RADIO,
                    _ => GROUND_STATION,
                };
                desk.receive_in_chunks(&encode_v2_from(sender, message_id, &payload), 64);
            }
            0x80..=0xBF => {
                let length = usize::from(input.byte());
                desk.receive_in_chunks(input.bytes(length), 64);
            }
            step => {
                desk.now_us += u64::from(step - 0xBF) * 20_000;
                desk.post_due(desk.now_us);
                desk.sent();
            }
        }
        let drives = desk.drive();
        let is_armed = desk.vehicle().arm_state() == ArmState::Armed;
        assert!(is_armed || drives == SideDrives::COAST);
    }
    assert_sound(&mut desk);
}

fn assert_sound(desk: &mut Desk) {
    for id in ParameterId::all() {
        let value = desk.parameters().get(id);
        let mut same = desk.parameters().clone();
        let (set, name) = (same.set(id, value), id.name());
        let name = name.as_str();
        assert!(matches!(set, Ok(()) | Err(Refused::ReadOnly)), "{name} = {value}");
        assert_eq!(same.get(id).to_bits(), value.to_bits(), "{name}");
    }
    desk.endpoint.give_up_waiting();
    desk.handle_all();
    // Whatever still waits leaves first.
    for _ in 0..1000 {
        if desk.sent().is_empty() {
            break;
        }
    }
    let system_id = desk.parameters().system_id();
    let answers = desk.ask(&param_read_from([system_id, 1], "BATT_MONITOR"));
    assert_eq!(of_message(&answers, PARAM_VALUE).len(), 1, "{answers:?}");
}
