//! Finds MAVLink frames in a stream of bytes.

use ::mavlink::{Message as _, calculate_crc};

use super::dialect::MavMessage;
use super::payload::Payload;
use crate::system::ReceiveStatistics;

const START_V1: u8 = 0xfe;
const START_V2: u8 = 0xfd;
const HEADER_V1_BYTES: usize = 6;
const HEADER_V2_BYTES: usize = 10;
const CRC_BYTES: usize = 2;

/// The only incompatibility flag a frame may carry here: it is signed.
pub const FLAG_SIGNED: u8 = 0x01;

/// Bytes of a signed frame behind its checksum: the link's number, the timestamp and the signature.
pub const TRAILER_BYTES: usize = 13;

/// The longest frame: MAVLink 2 with a full payload and a signature.
const MAX_FRAME_BYTES: usize = HEADER_V2_BYTES + u8::MAX as usize + CRC_BYTES + TRAILER_BYTES;

/// Room for the longest frame and for what arrives behind it in one go.
const BUFFER_BYTES: usize = 512;

// A frame that waits for its end, and for the header of the next one, must leave room for the bytes it waits for.
const _: () = assert!(BUFFER_BYTES > MAX_FRAME_BYTES + HEADER_V2_BYTES);

/// A frame whose checksum is right.
#[derive(Clone, Copy, Debug)]
pub struct ReceivedFrame<'a> {
    /// The sender's system id.
    pub system_id: u8,
    /// The sender's component id.
    pub component_id: u8,
    /// Which message it is.
    pub message_id: u32,
    /// Its fields.
    pub payload: Payload<'a>,
    /// The whole frame, if it is signed.
    pub signed: Option<&'a [u8]>,
}

/// The sender of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Its system id.
    pub system_id: u8,
    /// Its component id.
    pub component_id: u8,
}

/// Finds the frames of MAVLink 1 and 2 in what is received.
///
/// After a start byte that turns out to start no good frame it goes on at the very next byte, so a frame is never lost
/// to garbage before it, and at most 512 bytes pass before it is found. A frame is taken whole, also if it is useless: what
/// looks like a frame inside its payload is not one. One that can't be judged, since its message or one of its flags is
/// unknown here, counts as a frame between a frame or a pause right before it, and a frame, a pause or as many more such frames as
/// the buffer holds right behind it.
#[derive(Debug)]
pub struct FrameParser {
    buffer: [u8; BUFFER_BYTES],
    start: usize,
    end: usize,
    sender_paused: bool,
    /// Whether the first byte follows a frame or a pause, and no noise.
    follows_frame: bool,
    statistics: ReceiveStatistics,
}

/// The content at the start of the buffer.
enum Candidate {
    /// More bytes are needed to decide.
    Incomplete,
    NoFrame,
    BadChecksum,
    /// It can't be judged by itself: its message or one of its flags is unknown. It has this many bytes.
    Unknown(usize),
    Good(Layout),
}

/// The parts of a frame.
struct Layout {
    system_id: u8,
    component_id: u8,
    message_id: u32,
    header_bytes: usize,
    payload_bytes: usize,
    /// Zero if it is not signed.
    trailer_bytes: usize,
    frame_bytes: usize,
    /// Enters the checksum; `None` if the message or one of the flags is unknown.
    extra_crc: Option<u8>,
}

impl FrameParser {
    /// A parser that has seen nothing yet.
    pub const fn new() -> Self {
        Self {
            buffer: [0; BUFFER_BYTES],
            start: 0,
            end: 0,
            sender_paused: false,
            follows_frame: true,
            statistics: ReceiveStatistics {
                frames: 0,
                bad_checksums: 0,
                unknown_messages: 0,
                overruns: 0,
            },
        }
    }

    /// Counts of received frames so far.
    pub fn statistics(&self) -> ReceiveStatistics {
        self.statistics
    }

    /// Takes as many of `bytes` as there is room for and returns how many that were. After [`Self::next_frame`] has
    /// answered `None` there is room for at least one.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        // They are never larger; said here, the compiler leaves out the checks that could panic.
        let end = self.end.min(BUFFER_BYTES);
        let start = self.start.min(end);
        self.buffer.copy_within(start..end, 0);
        self.end = end - start;
        self.start = 0;
        let room = self.buffer.get_mut(self.end..).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        self.sender_paused &= taken == 0;
        for (place, byte) in room.iter_mut().zip(bytes) {
            *place = *byte;
        }
        self.end += taken;
        taken
    }

    /// Bytes were lost before they could be pushed.
    pub fn count_overrun(&mut self) {
        self.statistics.overruns = self.statistics.overruns.wrapping_add(1);
    }

    /// The sender has paused: what waits for more bytes will not get them, so it starts no frame. Frames that stand behind
    /// such a false start are found by [`Self::next_frame`].
    pub fn give_up_waiting(&mut self) {
        self.sender_paused = true;
    }

    /// The next good frame. Called until it answers `None`, which means that more bytes are needed.
    pub fn next_frame(&mut self) -> Option<ReceivedFrame<'_>> {
        let layout = self.find()?;
        let frame_start = self.start;
        self.start += layout.frame_bytes;
        let payload_start = frame_start + layout.header_bytes;
        let is_signed = layout.trailer_bytes > 0;
        Some(ReceivedFrame {
            system_id: layout.system_id,
            component_id: layout.component_id,
            message_id: layout.message_id,
            payload: Payload(self.bytes(payload_start, payload_start + layout.payload_bytes)),
            signed: is_signed.then(|| self.bytes(frame_start, self.start)),
        })
    }

    /// A part of the buffer.
    fn bytes(&self, start: usize, end: usize) -> &[u8] {
        self.buffer.get(start..end).unwrap_or_default()
    }

    /// Goes on to the next good frame and leaves `start` at it.
    fn find(&mut self) -> Option<Layout> {
        loop {
            let waiting = self.bytes(self.start, self.end);
            let Some(noise) = waiting
                .iter()
                .position(|byte| matches!(*byte, START_V1 | START_V2))
            else {
                self.follows_frame = self.sender_paused || (self.follows_frame && waiting.is_empty());
                self.start = self.end;
                return None;
            };
            let follows_frame = self.follows_frame && noise == 0;
            let waiting = waiting.get(noise..).unwrap_or_default();
            let candidate = match examine(waiting) {
                Candidate::Unknown(bytes) if follows_frame => {
                    judge_unknown(waiting, bytes, self.sender_paused)
                }
                Candidate::Unknown(_) => Candidate::NoFrame,
                known => known,
            };
            self.start += noise;
            self.follows_frame = follows_frame;
            match candidate {
                Candidate::Incomplete if !self.sender_paused => return None,
                Candidate::Good(layout) => {
                    self.follows_frame = true;
                    self.statistics.frames = self.statistics.frames.wrapping_add(1);
                    return Some(layout);
                }
                Candidate::Unknown(bytes) => {
                    self.statistics.unknown_messages = self.statistics.unknown_messages.wrapping_add(1);
                    self.start += bytes;
                    continue;
                }
                Candidate::BadChecksum => {
                    self.statistics.bad_checksums = self.statistics.bad_checksums.wrapping_add(1);
                }
                Candidate::Incomplete | Candidate::NoFrame => {}
            }
            self.follows_frame = false;
            self.start += 1;
        }
    }
}

impl Default for FrameParser {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether `bytes` begin with a good frame of a known message. At most one checksum is computed, whatever they are.
pub fn begins_with_frame(bytes: &[u8]) -> bool {
    matches!(examine(bytes), Candidate::Good(_))
}

/// Judges what starts with `bytes`, whose first one is a start byte.
fn examine(bytes: &[u8]) -> Candidate {
    let Some(layout) = layout(bytes) else {
        return Candidate::Incomplete;
    };
    let Some(extra_crc) = layout.extra_crc else {
        return Candidate::Unknown(layout.frame_bytes);
    };
    // The checksum covers everything before it but the start byte.
    let after_start = bytes.get(1..layout.frame_bytes);
    let covered_bytes = layout.header_bytes + layout.payload_bytes - 1;
    let Some((covered, checksum)) = after_start.and_then(|frame| frame.split_at_checked(covered_bytes))
    else {
        return Candidate::Incomplete;
    };
    if checksum.starts_with(&calculate_crc(covered, extra_crc).to_le_bytes()) {
        Candidate::Good(layout)
    } else {
        Candidate::BadChecksum
    }
}

/// Judges a frame of `frame_bytes` that can't be judged by itself, by the bytes behind it, which are all there are until the
/// sender goes on. More such frames may follow: a chain of them that reaches the end of the buffer is hardly noise.
fn judge_unknown(bytes: &[u8], frame_bytes: usize, sender_paused: bool) -> Candidate {
    let mut end = frame_bytes;
    while end + HEADER_V2_BYTES <= BUFFER_BYTES {
        let next = match bytes.get(end..) {
            Some([]) if sender_paused => return Candidate::Unknown(frame_bytes),
            Some([START_V1 | START_V2, ..]) => bytes.get(end..).and_then(layout),
            Some([_, ..]) => return Candidate::NoFrame,
            Some([]) | None => None,
        };
        match next {
            Some(next) if next.extra_crc.is_some() => return Candidate::Unknown(frame_bytes),
            Some(next) => end += next.frame_bytes,
            None if sender_paused => return Candidate::NoFrame,
            None => return Candidate::Incomplete,
        }
    }
    Candidate::Unknown(frame_bytes)
}

/// The parts of the frame that starts with `bytes`, whose first one is a start byte; `None` if they are too few.
fn layout(bytes: &[u8]) -> Option<Layout> {
    match *bytes {
        [
            START_V2,
            length,
            flags,
            _,
            _,
            system_id,
            component_id,
            id0,
            id1,
            id2,
            ..,
        ] => {
            let message_id = u32::from_le_bytes([id0, id1, id2, 0]);
            let frame_bytes = HEADER_V2_BYTES + usize::from(length) + CRC_BYTES;
            let trailer_bytes = if flags & FLAG_SIGNED != 0 {
                TRAILER_BYTES
            } else {
                0
            };
            Some(Layout {
                system_id,
                component_id,
                message_id,
                header_bytes: HEADER_V2_BYTES,
                payload_bytes: usize::from(length),
                trailer_bytes,
                frame_bytes: frame_bytes + trailer_bytes,
                extra_crc: extra_crc(message_id).filter(|_| flags & !FLAG_SIGNED == 0),
            })
        }
        [START_V1, length, _, system_id, component_id, id, ..] => Some(Layout {
            system_id,
            component_id,
            message_id: u32::from(id),
            header_bytes: HEADER_V1_BYTES,
            payload_bytes: usize::from(length),
            trailer_bytes: 0,
            frame_bytes: HEADER_V1_BYTES + usize::from(length) + CRC_BYTES,
            extra_crc: extra_crc(id.into()),
        }),
        _ => None,
    }
}

/// Enters the checksum of a message; `None` if the message is unknown.
fn extra_crc(message_id: u32) -> Option<u8> {
    // The dialect answers 0 for messages it does not know.
    Some(MavMessage::extra_crc(message_id)).filter(|extra_crc| *extra_crc != 0)
}
