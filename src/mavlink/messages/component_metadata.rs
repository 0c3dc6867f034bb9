//! COMPONENT_METADATA (397): where the descriptions of the parameters are.

use ::mavlink::bytes_mut::BytesMut;
use ::mavlink::error::ParserError;
use ::mavlink::{MavlinkVersion, MessageData};

use super::units::time_boot_ms;
use crate::mavlink::dialect::{COMPONENT_METADATA_DATA, MavMessage};
use crate::memory::checksum::file_crc32;
use crate::parameter::DescriptionFile;
use crate::system::SystemState;

/// Address of a file of MAVLink FTP, before its name.
const SCHEME: &[u8] = b"mftp://";

/// Address and checksum of [`DescriptionFile::General`].
///
/// The `mavlink` crate's own type holds the text, with which all messages that wait would take more memory. This one is the same on
/// the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComponentMetadata {
    /// Time since the start, in ms.
    pub time_boot_ms: u32,
}

/// The message, sent at this moment.
pub fn build_component_metadata(state: &SystemState<'_>) -> ComponentMetadata {
    ComponentMetadata {
        time_boot_ms: time_boot_ms(state.now),
    }
}

impl MessageData for ComponentMetadata {
    type Message = MavMessage;

    const ID: u32 = COMPONENT_METADATA_DATA::ID;
    const NAME: &'static str = COMPONENT_METADATA_DATA::NAME;
    const EXTRA_CRC: u8 = COMPONENT_METADATA_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = COMPONENT_METADATA_DATA::ENCODED_LEN;

    fn ser(&self, _version: MavlinkVersion, payload: &mut [u8]) -> usize {
        let file = DescriptionFile::General;
        let mut bytes = BytesMut::new(payload);
        bytes.put_u32_le(self.time_boot_ms);
        bytes.put_u32_le(file_crc32(0, file.content()));
        bytes.put_slice(SCHEME);
        bytes.put_slice(file.name().as_bytes());
        // The text has room for more; the zeros behind it are not sent.
        bytes.len()
    }

    /// # Errors
    /// Always: it is sent only.
    fn deser(_version: MavlinkVersion, _payload: &[u8]) -> Result<Self, ParserError> {
        Err(ParserError::UnknownMessage { id: Self::ID })
    }
}
