//! What leaves next on a link.

use ::mavlink::{MAVLinkV2MessageRaw, MavHeader};

use super::{FileData, Message};

/// What leaves next on a link.
///
/// Bytes of files are no [`Message`]: of these many wait, and the longest decides how much memory each takes.
#[derive(Clone, Debug, PartialEq)]
pub enum Outgoing {
    /// A message.
    Message(Message),
    /// An answer of MAVLink FTP with bytes of a file.
    FileData(FileData),
}

/// What becomes a frame.
pub trait ToFrame {
    /// The system id that sends it, if that is not the vehicle's at present.
    fn sender_system(&self) -> Option<u8>;

    /// Writes it as a MAVLink 2 frame into `frame`.
    fn serialize(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw);
}

impl ToFrame for Message {
    fn sender_system(&self) -> Option<u8> {
        match self {
            Self::FileAnswer(answer) => Some(answer.header.sender_system),
            _ => None,
        }
    }

    fn serialize(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw) {
        self.write(header, frame);
    }
}

impl ToFrame for Outgoing {
    fn sender_system(&self) -> Option<u8> {
        match self {
            Self::Message(message) => message.sender_system(),
            Self::FileData(data) => Some(data.header.sender_system),
        }
    }

    fn serialize(&self, header: MavHeader, frame: &mut MAVLinkV2MessageRaw) {
        match self {
            Self::Message(message) => message.write(header, frame),
            Self::FileData(data) => frame.serialize_message_data(header, data),
        }
    }
}
