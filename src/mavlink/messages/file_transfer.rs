//! FILE_TRANSFER_PROTOCOL (110): MAVLink FTP, which this vehicle does not offer.
//!
//! Ground stations ask for the parameters by FTP first. Silence costs them many seconds; a refusal sends them to the
//! parameter protocol at once.

use ::mavlink::bytes_mut::BytesMut;
use ::mavlink::error::ParserError;
use ::mavlink::{MavlinkVersion, MessageData};

use crate::mavlink::Peer;
use crate::mavlink::dialect::{FILE_TRANSFER_PROTOCOL_DATA, MavMessage};
use crate::mavlink::payload::Payload;
use crate::mavlink::requests::FileTransfer;

/// Places of fields on the wire.
const SEQUENCE_AT: usize = 3;
const SESSION_AT: usize = 5;
const REQUEST_OPCODE_AT: usize = 8;

/// Requests have lower opcodes.
const OPCODE_ACK: u8 = 128;
const OPCODE_NAK: u8 = 129;
const ERROR_UNKNOWN_COMMAND: u8 = 7;

/// The refusal of one FTP request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileTransferNak {
    /// Who had asked.
    pub target_system: u8,
    /// Which component of that system had.
    pub target_component: u8,
    sequence: u16,
    session: u8,
    request_opcode: u8,
}

impl FileTransferNak {
    /// Refuses a request. An answer that came instead of one is not answered.
    pub(in crate::mavlink) fn refuse(request: &FileTransfer, to: Peer) -> Option<Self> {
        (request.opcode < OPCODE_ACK).then(|| Self {
            target_system: to.system_id,
            target_component: to.component_id,
            // An answer carries the request's sequence number plus one.
            sequence: request.sequence.wrapping_add(1),
            session: request.session,
            request_opcode: request.opcode,
        })
    }
}

impl MessageData for FileTransferNak {
    type Message = MavMessage;

    const ID: u32 = FILE_TRANSFER_PROTOCOL_DATA::ID;
    const NAME: &'static str = FILE_TRANSFER_PROTOCOL_DATA::NAME;
    const EXTRA_CRC: u8 = FILE_TRANSFER_PROTOCOL_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = FILE_TRANSFER_PROTOCOL_DATA::ENCODED_LEN;

    fn ser(&self, _version: MavlinkVersion, payload: &mut [u8]) -> usize {
        let mut bytes = BytesMut::new(payload);
        // Target network: the same one.
        bytes.put_u8(0);
        bytes.put_u8(self.target_system);
        bytes.put_u8(self.target_component);
        bytes.put_u16_le(self.sequence);
        bytes.put_u8(self.session);
        bytes.put_u8(OPCODE_NAK);
        // One byte of data: the error.
        bytes.put_u8(1);
        bytes.put_u8(self.request_opcode);
        // Burst complete, padding, offset.
        bytes.put_u16_le(0);
        bytes.put_u32_le(0);
        bytes.put_u8(ERROR_UNKNOWN_COMMAND);
        bytes.len()
    }

    /// # Errors
    /// Never.
    fn deser(_version: MavlinkVersion, payload: &[u8]) -> Result<Self, ParserError> {
        let payload = Payload(payload);
        Ok(Self {
            target_system: payload.u8(1),
            target_component: payload.u8(2),
            sequence: payload.u16(SEQUENCE_AT),
            session: payload.u8(SESSION_AT),
            request_opcode: payload.u8(REQUEST_OPCODE_AT),
        })
    }
}
