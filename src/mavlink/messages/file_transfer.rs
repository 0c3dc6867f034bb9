//! FILE_TRANSFER_PROTOCOL (110): answers of MAVLink FTP.
//!
//! There are two types of the one message: answers without bytes of a file are small enough to wait among other answers.

use ::mavlink::bytes_mut::BytesMut;
use ::mavlink::error::ParserError;
use ::mavlink::{MavlinkVersion, MessageData};
use heapless::Vec;

use crate::mavlink::Peer;
use crate::mavlink::dialect::{FILE_TRANSFER_PROTOCOL_DATA, MavMessage};

/// Bytes of a file, or of a list of them, that one message has room for.
pub const MAX_FILE_BYTES: usize = 239;

const OPCODE_ACK: u8 = 128;
const OPCODE_NAK: u8 = 129;

/// Which request is answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileAnswerHeader {
    /// The sender of the request.
    pub to: Peer,
    /// The system id that the request was addressed to: the sender expects the answer from it, also when the request has
    /// changed it.
    pub sender_system: u8,
    /// The answer's sequence number: the request's plus one, and so on for more answers to one request.
    pub sequence: u16,
    /// The session.
    pub session: u8,
    /// The request's opcode.
    pub request_opcode: u8,
}

/// Why a request fails, by MAVLink's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum FileError {
    /// It can't be done now, or the file has no such content.
    Fail = 1,
    /// More bytes than a request has, or no path.
    InvalidDataSize = 3,
    /// No such session is open.
    InvalidSession = 4,
    /// Another ground station on the link has the session.
    NoSessionsAvailable = 5,
    /// There is nothing behind this offset.
    EndOfFile = 6,
    /// The opcode is unknown.
    UnknownCommand = 7,
    /// It can be read only.
    FileProtected = 9,
    /// There is no such file or directory.
    FileNotFound = 10,
}

/// The result in an answer without bytes of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileOutcome {
    /// It was done.
    Done,
    /// It was done, with this number: a file's size in bytes, or its checksum.
    Number(u32),
    /// It failed.
    Failed(FileError),
}

/// Whether a burst ends with an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Burst {
    /// More follows, or it is not a burst.
    Continues,
    /// The next burst has to be requested.
    Complete,
}

/// An answer without bytes of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileAnswer {
    /// Which request is answered.
    pub header: FileAnswerHeader,
    /// Whether it ends a burst.
    pub burst: Burst,
    /// The place in the file, in bytes, or in the list.
    pub offset: u32,
    /// Result of the request.
    pub outcome: FileOutcome,
}

/// An answer with bytes of a file, or of a list of files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileData {
    /// Which request is answered.
    pub header: FileAnswerHeader,
    /// Whether it ends a burst.
    pub burst: Burst,
    /// The place of the first byte in the file, or of the first entry in the list.
    pub offset: u32,
    /// The bytes.
    pub data: Vec<u8, MAX_FILE_BYTES>,
}

/// Writes an answer, and returns the payload's length on the wire.
fn serialize(
    payload: &mut [u8],
    header: FileAnswerHeader,
    opcode: u8,
    burst: Burst,
    offset: u32,
    data: &[u8],
) -> usize {
    let mut bytes = BytesMut::new(payload);
    // Target network: the same one.
    bytes.put_u8(0);
    bytes.put_u8(header.to.system_id);
    bytes.put_u8(header.to.component_id);
    bytes.put_u16_le(header.sequence);
    bytes.put_u8(header.session);
    bytes.put_u8(opcode);
    // There is room for 239.
    bytes.put_u8(data.len() as u8);
    bytes.put_u8(header.request_opcode);
    bytes.put_u8(u8::from(burst == Burst::Complete));
    // Padding.
    bytes.put_u8(0);
    bytes.put_u32_le(offset);
    bytes.put_slice(data);
    let length = bytes.len();
    ::mavlink::utils::remove_trailing_zeroes(&payload[..length])
}

impl MessageData for FileAnswer {
    type Message = MavMessage;

    const ID: u32 = FILE_TRANSFER_PROTOCOL_DATA::ID;
    const NAME: &'static str = FILE_TRANSFER_PROTOCOL_DATA::NAME;
    const EXTRA_CRC: u8 = FILE_TRANSFER_PROTOCOL_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = FILE_TRANSFER_PROTOCOL_DATA::ENCODED_LEN;

    fn ser(&self, _version: MavlinkVersion, payload: &mut [u8]) -> usize {
        let number;
        let error;
        let (opcode, data): (u8, &[u8]) = match self.outcome {
            FileOutcome::Done => (OPCODE_ACK, &[]),
            FileOutcome::Number(value) => {
                number = value.to_le_bytes();
                (OPCODE_ACK, &number)
            }
            FileOutcome::Failed(reason) => {
                error = [reason as u8];
                (OPCODE_NAK, &error)
            }
        };
        serialize(payload, self.header, opcode, self.burst, self.offset, data)
    }

    /// # Errors
    /// Always: answers are sent only.
    fn deser(_version: MavlinkVersion, _payload: &[u8]) -> Result<Self, ParserError> {
        Err(ParserError::UnknownMessage { id: Self::ID })
    }
}

impl MessageData for FileData {
    type Message = MavMessage;

    const ID: u32 = FILE_TRANSFER_PROTOCOL_DATA::ID;
    const NAME: &'static str = FILE_TRANSFER_PROTOCOL_DATA::NAME;
    const EXTRA_CRC: u8 = FILE_TRANSFER_PROTOCOL_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = FILE_TRANSFER_PROTOCOL_DATA::ENCODED_LEN;

    fn ser(&self, _version: MavlinkVersion, payload: &mut [u8]) -> usize {
        serialize(
            payload,
            self.header,
            OPCODE_ACK,
            self.burst,
            self.offset,
            &self.data,
        )
    }

    /// # Errors
    /// Always: answers are sent only.
    fn deser(_version: MavlinkVersion, _payload: &[u8]) -> Result<Self, ParserError> {
        Err(ParserError::UnknownMessage { id: Self::ID })
    }
}
