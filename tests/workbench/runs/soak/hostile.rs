//! What a board must not act upon: garbage, frames that are damaged, that are for others, or that ask for what there is
//! not.
//!
//! Left out is what a ground station or a radio may do: without signing nothing distinguishes a hostile one. That includes
//! RADIO_STATUS of a radio, which slows telemetry down, and a HEARTBEAT of a ground station.

use crate::signing_key::STRANGER;
use emulator::Random;
use support::frames::{
    COMMAND_INT, COMMAND_LONG, FILE_TRANSFER_PROTOCOL, HEARTBEAT, MANUAL_CONTROL, PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ, PARAM_SET, PING, RC_CHANNELS_OVERRIDE, REQUEST_DATA_STREAM, SET_MODE, TIMESYNC,
    encode_v1, encode_v2, encode_v2_with_flags,
};
use support::requests::{
    EVERYONE, VEHICLE, arm, command_int, command_long, ftp_open, heartbeat, manual_control,
    param_read_by_name, param_set, param_set_payload, rc_override, reboot, set_mode,
};
use support::signer::Signer;

/// Bytes that have to leave a board as it is.
pub fn hostile(random: &mut Random) -> Vec<u8> {
    match random.below(9) {
        0 => garbage(random, 300),
        // Bytes that each begin a frame.
        1 => vec![random.pick(&[0xfd, 0xfe]); 1 + random.below(300)],
        // A request that ends too soon.
        2 => {
            let mut frame = request(random);
            // Not the checksum alone, which what follows could happen to complete.
            frame.truncate(1 + random.below(frame.len() - 1 - CHECKSUM_BYTES));
            frame
        }
        // Its length is another than it says.
        3 => {
            let mut frame = request(random);
            frame[LENGTH_AT] ^= 1 + random.below(255) as u8;
            frame
        }
        // A wrong checksum.
        4 => {
            let mut frame = request(random);
            *frame.last_mut().expect("a checksum") ^= 1 + random.below(255) as u8;
            frame
        }
        // An unknown incompatibility flag.
        5 => {
            let payload = param_set_payload(VEHICLE, "SR0_EXTRA1", 50.0);
            encode_v2_with_flags(2 << random.below(7), PARAM_SET, &payload)
        }
        6 => {
            let mut frame = encode_v2(HEARTBEAT, &garbage(random, 255));
            frame[MESSAGE_ID_AT..MESSAGE_ID_AT + 3].copy_from_slice(&UNKNOWN_MESSAGE);
            frame
        }
        7 => for_another(random),
        _ => nonsense(random),
    }
}

/// What only a signature keeps out: a sound request that is not signed or signed with another key, or what the owner has
/// sent before.
pub fn stranger(random: &mut Random, recording: Option<&Vec<u8>>) -> Vec<u8> {
    match (random.below(3), recording) {
        (0, _) => request(random),
        (1, Some(recording)) => recording.clone(),
        _ => {
            let mut stranger = Signer::new(STRANGER);
            stranger.timestamp += random.next_u64() >> 20;
            stranger.sign(&request(random))
        }
    }
}

/// Places in a MAVLink 2 frame.
const LENGTH_AT: usize = 1;
const MESSAGE_ID_AT: usize = 7;
const PAYLOAD_AT: usize = 10;
const CHECKSUM_BYTES: usize = 2;

const UNKNOWN_MESSAGE: [u8; 3] = [0x10, 0x27, 0];

const ANOTHER: u8 = 42;

fn garbage(random: &mut Random, longest: usize) -> Vec<u8> {
    let mut bytes = vec![0; 1 + random.below(longest)];
    random.fill(&mut bytes);
    bytes
}

/// What would do harm if it were taken.
fn request(random: &mut Random) -> Vec<u8> {
    match random.below(6) {
        0 => param_set("BATT_VOLT_MULT", 9.0),
        1 => param_set("SR0_EXTRA1", 50.0),
        2 => reboot(),
        3 => arm(),
        4 => set_mode(1, 1, 0),
        _ => manual_control(1, -900, 900),
    }
}

/// Message, length of its payload, and where the system is that it is for.
const TARGETED: [(u32, usize, usize); 12] = [
    (PING, 14, 12),
    (SET_MODE, 6, 4),
    (PARAM_REQUEST_READ, 20, 2),
    (PARAM_REQUEST_LIST, 2, 0),
    (PARAM_SET, 23, 4),
    (REQUEST_DATA_STREAM, 6, 2),
    (MANUAL_CONTROL, 11, 10),
    (RC_CHANNELS_OVERRIDE, 18, 16),
    (COMMAND_INT, 35, 30),
    (COMMAND_LONG, 33, 30),
    (FILE_TRANSFER_PROTOCOL, 254, 1),
    (TIMESYNC, 18, 16),
];

/// Any payload, or one that would do harm, sound in itself, for another system.
fn for_another(random: &mut Random) -> Vec<u8> {
    let (message, mut payload) = match random.below(2) {
        0 => (random.pick(&TARGETED).0, garbage(random, 255)),
        _ => {
            let frame = request(random);
            let payload = &frame[PAYLOAD_AT..frame.len() - CHECKSUM_BYTES];
            (u32::from(frame[MESSAGE_ID_AT]), payload.to_vec())
        }
    };
    let place = TARGETED.iter().find(|(targeted, ..)| *targeted == message);
    let (_, length, target_at) = *place.expect("it has a target");
    payload.resize(length, 0);
    payload[target_at] = ANOTHER;
    // In MAVLink 1 a TIMESYNC is for everyone.
    if random.below(2) == 0 && message != TIMESYNC {
        encode_v1(message, &payload)
    } else {
        encode_v2(message, &payload)
    }
}

/// A request to this board for what it does not have, or with values that it refuses.
fn nonsense(random: &mut Random) -> Vec<u8> {
    match random.below(9) {
        0 => param_set(
            "BATT_VOLT_MULT",
            random.pick(&[f32::NAN, f32::INFINITY, -1e30, 1e30]),
        ),
        1 => param_set("NO_SUCH_NAME", 1.0),
        2 => param_read_by_name("NO_SUCH_NAME"),
        3 => command_long(UNKNOWN_COMMANDS + random.below(500) as u16, f32::NAN),
        4 => command_int(UNKNOWN_COMMANDS + random.below(500) as u16, -1e30),
        5 => set_mode(1, 1, 1000 + random.below(1000) as u32),
        6 => ftp_open(random.below(1000) as u16, "../../etc"),
        // Stick input is for one rover only, and other channels are not stick input.
        7 => {
            let (target, pulse_us) = random.pick(&[(EVERYONE, 2000), ([1, 154], 2000), (VEHICLE, u16::MAX)]);
            rc_override(target, pulse_us, pulse_us)
        }
        // A camera's, an antenna tracker's and so on, and not a ground station's.
        _ => heartbeat(random.pick(&[0, 1, 5, 7, 26, 30, 255])),
    }
}

/// Far from those there are.
const UNKNOWN_COMMANDS: u16 = 65_000;
