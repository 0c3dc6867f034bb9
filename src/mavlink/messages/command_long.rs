//! COMMAND_LONG (76) to every component in reach.

use ::mavlink::bytes_mut::BytesMut;
use ::mavlink::error::ParserError;
use ::mavlink::{MavlinkVersion, MessageData};

use crate::mavlink::dialect::{COMMAND_LONG_DATA, MavMessage};
use crate::mavlink::payload::Payload;
use crate::pack::Pack;

/// MAV_CMD_POWER_OFF_INITIATED of ArduPilot's dialect: MAVLink has no parameters for it, ArduPilot sends the pack's number.
const POWER_OFF_INITIATED: u16 = 42000;

/// Place of the command's number on the wire, after its seven parameters.
const NUMBER_AT: usize = 28;

/// A command with one parameter.
///
/// As [`CommandAck`](super::CommandAck) it takes every number, which the `mavlink` crate's own type does not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BroadcastCommand {
    /// The number of the command.
    pub number: u16,
    /// Its parameter 1; the others are 0.
    pub param1: f32,
}

impl BroadcastCommand {
    /// A pack is being switched off, as ArduPilot reports it.
    pub fn power_off_initiated(pack: Pack) -> Self {
        Self {
            number: POWER_OFF_INITIATED,
            param1: pack.number().into(),
        }
    }
}

impl MessageData for BroadcastCommand {
    type Message = MavMessage;

    const ID: u32 = COMMAND_LONG_DATA::ID;
    const NAME: &'static str = COMMAND_LONG_DATA::NAME;
    const EXTRA_CRC: u8 = COMMAND_LONG_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = COMMAND_LONG_DATA::ENCODED_LEN;

    fn ser(&self, _version: MavlinkVersion, payload: &mut [u8]) -> usize {
        let mut bytes = BytesMut::new(payload);
        bytes.put_f32_le(self.param1);
        while bytes.len() < NUMBER_AT {
            bytes.put_u8(0);
        }
        bytes.put_u16_le(self.number);
        // Without what follows, target and confirmation are 0.
        bytes.len()
    }

    /// # Errors
    /// Never.
    fn deser(_version: MavlinkVersion, payload: &[u8]) -> Result<Self, ParserError> {
        let payload = Payload(payload);
        Ok(Self {
            number: payload.u16(NUMBER_AT),
            param1: payload.f32(0),
        })
    }
}
