//! Frames of a WebSocket (RFC 6455), as they come.

use edge_ws::{Error, FrameHeader, FrameType};
use heapless::Vec;

/// The longest header of a frame.
const HEADER_BYTES: usize = FrameHeader::MAX_LEN;

/// The longest payload of a frame that says something about the connection.
const CONTROL_BYTES: usize = 125;

/// The longest payload of a frame of data: stations send a few MAVLink frames in each, which have 280 bytes at most.
const DATA_BYTES: u64 = 4096;

/// The longest answer to a ping.
const PONG_BYTES: usize = 2 + CONTROL_BYTES;

const FINAL: u8 = 0x80;

/// Why a WebSocket ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The other side has closed it.
    Closed,
    /// Another page takes the slot over.
    SlotTaken,
    /// Bytes that are not a client's frame, or not in order.
    ProtocolError,
    /// Text: MAVLink is binary.
    Unsupported,
    TooLong,
}

impl End {
    /// The number that is sent for it.
    pub fn code(self) -> u16 {
        match self {
            Self::Closed => 1000,
            Self::SlotTaken => 1001,
            Self::ProtocolError => 1002,
            Self::Unsupported => 1003,
            Self::TooLong => 1009,
        }
    }
}

/// The payload of a frame, as far as it has not come yet.
#[derive(Clone, Copy, Debug)]
struct Payload {
    kind: FrameType,
    mask: [u8; 4],
    /// Bytes that have come.
    at: u64,
    bytes: u64,
}

/// Whether a message of several frames has begun.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Message {
    #[default]
    Complete,
    Begun,
}

/// Takes the payload out of the frames of a client. The binary messages are pieces of a stream: where they end means nothing.
#[derive(Debug, Default)]
pub struct FrameDecoder {
    header: Vec<u8, HEADER_BYTES>,
    payload: Option<Payload>,
    message: Message,
    /// The payload of the frame about the connection that came last, or comes now.
    control: Vec<u8, CONTROL_BYTES>,
    /// Whether that has to be sent back.
    pong: Pong,
    end: Option<End>,
}

/// Whether an answer to a ping is due.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Pong {
    #[default]
    NotDue,
    Due,
}

impl FrameDecoder {
    /// Takes what was received, puts the payload to the front of it, and says how long that is.
    pub fn decode(&mut self, received: &mut [u8]) -> usize {
        let mut length = 0;
        for index in 0..received.len() {
            if self.end.is_some() {
                break;
            }
            let byte = received.get(index).copied().unwrap_or_default();
            if let Some(data) = self.take(byte) {
                // Never ahead of what is read.
                if let Some(byte) = received.get_mut(length) {
                    *byte = data;
                }
                length += 1;
            }
        }
        length
    }

    /// Why the WebSocket has to end, if it has to.
    pub fn end(&self) -> Option<End> {
        self.end
    }

    /// The frame that has to be sent back for a ping, once.
    pub fn take_pong(&mut self) -> Option<Vec<u8, PONG_BYTES>> {
        match core::mem::take(&mut self.pong) {
            Pong::Due => {
                let mut pong = Vec::new();
                // The longest fits.
                let _ = pong.extend_from_slice(&header(FrameType::Pong, self.control.len()));
                let _ = pong.extend_from_slice(&self.control);
                Some(pong)
            }
            Pong::NotDue => None,
        }
    }

    /// Whether [`Self::take_pong`] has something.
    pub fn has_pong(&self) -> bool {
        self.pong == Pong::Due
    }

    /// Takes a byte. Returns one of the stream.
    fn take(&mut self, byte: u8) -> Option<u8> {
        let Some(payload) = &mut self.payload else {
            self.take_header(byte);
            return None;
        };
        let byte = byte
            ^ payload
                .mask
                .get(payload.at as usize % 4)
                .copied()
                .unwrap_or_default();
        payload.at += 1;
        let Payload { kind, at, bytes, .. } = *payload;
        let data = match kind {
            FrameType::Binary(_) | FrameType::Continue(_) => Some(byte),
            _ => {
                // Longer ones were not begun.
                let _ = self.control.push(byte);
                None
            }
        };
        if at == bytes {
            self.finish(kind);
        }
        data
    }

    fn take_header(&mut self, byte: u8) {
        // A complete one is taken before there are more bytes than fit.
        let _ = self.header.push(byte);
        match FrameHeader::deserialize(&self.header) {
            Ok((header, _)) => {
                let is_final = self.header.first().is_some_and(|first| first & FINAL != 0);
                self.header.clear();
                if let Err(end) = self.begin(&header, is_final) {
                    self.end = Some(end);
                }
            }
            Err(Error::Incomplete(_)) => {}
            Err(_) => self.end = Some(End::ProtocolError),
        }
    }

    /// Begins the payload of a frame.
    fn begin(&mut self, header: &FrameHeader, is_final: bool) -> Result<(), End> {
        let (kind, bytes) = (header.frame_type, header.payload_len);
        let mask = header.mask_key.ok_or(End::ProtocolError)?.to_be_bytes();
        match kind {
            FrameType::Text(_) => return Err(End::Unsupported),
            FrameType::Binary(_) if self.message == Message::Begun => return Err(End::ProtocolError),
            FrameType::Continue(_) if self.message == Message::Complete => return Err(End::ProtocolError),
            FrameType::Binary(_) | FrameType::Continue(_) if bytes > DATA_BYTES => return Err(End::TooLong),
            FrameType::Binary(_) | FrameType::Continue(_) => {
                self.message = if is_final {
                    Message::Complete
                } else {
                    Message::Begun
                };
            }
            FrameType::Ping | FrameType::Pong | FrameType::Close => {
                if !is_final || bytes > CONTROL_BYTES as u64 {
                    return Err(End::ProtocolError);
                }
                self.control.clear();
                self.pong = Pong::NotDue;
            }
        }
        if bytes == 0 {
            self.finish(kind);
        } else {
            self.payload = Some(Payload {
                kind,
                mask,
                at: 0,
                bytes,
            });
        }
        Ok(())
    }

    fn finish(&mut self, kind: FrameType) {
        self.payload = None;
        match kind {
            FrameType::Ping => self.pong = Pong::Due,
            FrameType::Close => self.end = Some(End::Closed),
            _ => {}
        }
    }
}

/// The header of a frame of ours with this many bytes.
pub fn header(kind: FrameType, bytes: usize) -> Vec<u8, HEADER_BYTES> {
    let header = FrameHeader {
        frame_type: kind,
        payload_len: bytes as u64,
        mask_key: None,
    };
    let mut serialized = Vec::new();
    // The longest fits.
    let _ = serialized.resize_default(header.serialized_len());
    let _ = header.serialize(&mut serialized);
    serialized
}
