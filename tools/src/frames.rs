//! From bytes to MAVLink 2 frames and back, and the requests of a ground station.
//!
//! Not by the firmware's own parser, which is under test here, and which skips the damage between frames that is reported here.

use ::mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message, calculate_crc};
use rover_battmon::mavlink::dialect::{COMMAND_LONG_DATA, MavCmd, MavMessage, MavParamType, PARAM_SET_DATA};

const START: u8 = 0xfd;
const FLAG_SIGNED: u8 = 1;
const HEADER_BYTES: usize = 10;
const CRC_BYTES: usize = 2;
const SIGNATURE_BYTES: usize = 13;
const LONGEST_FRAME: usize = HEADER_BYTES + 255 + CRC_BYTES + SIGNATURE_BYTES;

/// The ids of a ground station: 255, `MAV_COMP_ID_MISSIONPLANNER`.
const GROUND_STATION: MavHeader = MavHeader {
    system_id: 255,
    component_id: 190,
    sequence: 0,
};

/// A frame whose checksum is right.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The sender's system id.
    pub system_id: u8,
    /// The sender's component id.
    pub component_id: u8,
    /// The sender's count of frames, modulo 256.
    pub sequence: u8,
    /// Whether bytes stand before it that are not part of a good frame.
    pub is_after_damage: bool,
    /// Its content; `None` if a field has a value that the dialect does not know.
    pub message: Option<MavMessage>,
}

/// Finds frames in what is received.
#[derive(Debug, Default)]
pub struct FrameReader {
    waiting: Vec<u8>,
}

impl FrameReader {
    /// Takes bytes and returns the frames that they complete.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Frame> {
        self.waiting.extend(bytes);
        let mut frames = Vec::new();
        while let Some((start, length, frame)) = self.find() {
            let is_after_damage = start > 0;
            frames.push(Frame {
                is_after_damage,
                ..frame
            });
            self.waiting.drain(..start + length);
        }
        // A byte in front of where a frame may have begun stays: it is damage, to be counted with the next frame.
        let surplus = self.waiting.len().saturating_sub(LONGEST_FRAME + 1);
        self.waiting.drain(..surplus);
        frames
    }

    /// The first good frame: where it starts and how long it is. What looks like the start of a frame does not hide it.
    fn find(&self) -> Option<(usize, usize, Frame)> {
        (0..self.waiting.len()).find_map(|start| {
            let (length, frame) = examine(self.waiting.get(start..)?)?;
            Some((start, length, frame))
        })
    }
}

/// The good frame at the start of `bytes`.
fn examine(bytes: &[u8]) -> Option<(usize, Frame)> {
    let [
        START,
        length,
        flags,
        _,
        sequence,
        system_id,
        component_id,
        id0,
        id1,
        id2,
        ..,
    ] = *bytes
    else {
        return None;
    };
    if flags & !FLAG_SIGNED != 0 {
        return None;
    }
    let message_id = u32::from_le_bytes([id0, id1, id2, 0]);
    let covered = bytes.get(1..HEADER_BYTES + usize::from(length))?;
    let crc_end = HEADER_BYTES + usize::from(length) + CRC_BYTES;
    let crc = bytes.get(crc_end - CRC_BYTES..crc_end)?;
    let end = crc_end + if flags == FLAG_SIGNED { SIGNATURE_BYTES } else { 0 };
    if bytes.len() < end || calculate_crc(covered, MavMessage::extra_crc(message_id)).to_le_bytes() != *crc {
        return None;
    }
    let payload = covered.get(HEADER_BYTES - 1..)?;
    let frame = Frame {
        system_id,
        component_id,
        sequence,
        is_after_damage: false,
        message: MavMessage::parse(MavlinkVersion::V2, message_id, payload).ok(),
    };
    Some((end, frame))
}

/// Requests are for the autopilot, `MAV_COMP_ID_AUTOPILOT1`, whatever id the board sends with.
pub const AUTOPILOT: u8 = 1;

/// COMMAND_LONG with the first four parameters; the others are 0.
pub fn command(target_system: u8, command: MavCmd, [param1, param2, param3, param4]: [f32; 4]) -> MavMessage {
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        command,
        param1,
        param2,
        param3,
        param4,
        target_system,
        target_component: AUTOPILOT,
        ..COMMAND_LONG_DATA::DEFAULT
    })
}

/// PARAM_SET.
pub fn set_parameter(target_system: u8, name: &str, value: f32) -> MavMessage {
    MavMessage::PARAM_SET(PARAM_SET_DATA {
        param_value: value,
        target_system,
        target_component: AUTOPILOT,
        param_id: name.into(),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    })
}

/// The bytes of a ground station's frame.
pub fn frame(sequence: u8, message: &MavMessage) -> Vec<u8> {
    let mut raw = MAVLinkV2MessageRaw::new();
    raw.serialize_message(
        MavHeader {
            sequence,
            ..GROUND_STATION
        },
        message,
    );
    raw.raw_bytes().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rover_battmon::mavlink::dialect::TIMESYNC_DATA;

    const MESSAGE: MavMessage = MavMessage::TIMESYNC(TIMESYNC_DATA {
        tc1: -5,
        ts1: 7,
        target_system: 1,
        target_component: 1,
    });

    fn numbered(sequence: u8) -> Vec<u8> {
        frame(sequence, &MESSAGE)
    }

    fn sequences(frames: &[Frame]) -> Vec<u8> {
        frames.iter().map(|frame| frame.sequence).collect()
    }

    #[test]
    fn frames_are_found_behind_damage_and_false_starts() {
        let mut damaged = numbered(2);
        damaged[12] ^= 1;
        let false_start = [START, 255, 0, 0, 0, 1, 1];
        let bytes = [
            numbered(1),
            damaged,
            numbered(3),
            numbered(4),
            false_start.to_vec(),
            numbered(5),
        ]
        .concat();
        let frames = FrameReader::default().take(&bytes);
        let found: Vec<_> = frames
            .iter()
            .map(|frame| (frame.sequence, frame.is_after_damage))
            .collect();
        assert_eq!(found, [(1, false), (3, true), (4, false), (5, true)]);
    }

    #[test]
    fn frame_is_read_as_it_was_written() {
        let expected = Frame {
            system_id: 255,
            component_id: 190,
            sequence: 9,
            is_after_damage: false,
            message: Some(MESSAGE),
        };
        assert_eq!(FrameReader::default().take(&numbered(9)), [expected]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived_and_the_next_frame_is_found(
            noise in proptest::collection::vec(any::<u8>(), 0..2000),
            chunk in 1_usize..100,
        ) {
            let mut reader = FrameReader::default();
            for part in noise.chunks(chunk) {
                reader.take(part);
            }
            prop_assert!(reader.waiting.len() <= LONGEST_FRAME + 1);
            let frames = reader.take(&numbered(7));
            prop_assert_eq!(sequences(&frames).last().copied(), Some(7));
        }

        #[test]
        fn frames_are_found_alike_in_any_chunks(chunk in 1_usize..60) {
            let bytes = (0..20).flat_map(numbered).collect::<Vec<_>>();
            let mut reader = FrameReader::default();
            let frames: Vec<_> = bytes.chunks(chunk).flat_map(|part| reader.take(part)).collect();
            prop_assert_eq!(sequences(&frames), (0..20).collect::<Vec<_>>());
        }
    }
}
