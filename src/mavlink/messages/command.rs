//! COMMAND_ACK (77), and COMMAND_LONG (76) to every component in reach.

use ::mavlink::bytes_mut::BytesMut;
use ::mavlink::error::ParserError;
use ::mavlink::{MavlinkVersion, MessageData};
use num_traits::FromPrimitive;

use crate::mavlink::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavMessage, MavResult};
use crate::mavlink::payload::Payload;
use crate::pack::Pack;

/// The answer to a command.
///
/// The `mavlink` crate's own type holds the command as an enum of those the dialect knows, so that it can't answer
/// "unsupported" to any other. This one is the same on the wire and takes every number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandAck {
    /// The number of the command that is answered.
    pub command: u16,
    /// Its result.
    pub result: MavResult,
    /// Its sender.
    pub target_system: u8,
    /// Which component of that system had.
    pub target_component: u8,
}

/// Places of fields on the wire.
const RESULT_AT: usize = 2;
const TARGET_SYSTEM_AT: usize = 8;

impl MessageData for CommandAck {
    type Message = MavMessage;

    const ID: u32 = COMMAND_ACK_DATA::ID;
    const NAME: &'static str = COMMAND_ACK_DATA::NAME;
    const EXTRA_CRC: u8 = COMMAND_ACK_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = COMMAND_ACK_DATA::ENCODED_LEN;

    fn ser(&self, _version: MavlinkVersion, payload: &mut [u8]) -> usize {
        let mut bytes = BytesMut::new(payload);
        bytes.put_u16_le(self.command);
        bytes.put_u8(self.result as u8);
        // progress and result_param2: nothing to report.
        while bytes.len() < TARGET_SYSTEM_AT {
            bytes.put_u8(0);
        }
        bytes.put_u8(self.target_system);
        bytes.put_u8(self.target_component);
        let length = bytes.len();
        ::mavlink::utils::remove_trailing_zeroes(&payload[..length])
    }

    /// # Errors
    /// The result is not one of `MAV_RESULT`.
    fn deser(_version: MavlinkVersion, payload: &[u8]) -> Result<Self, ParserError> {
        let payload = Payload(payload);
        let value = payload.u8(RESULT_AT);
        let result = MavResult::from_u8(value).ok_or(ParserError::InvalidEnum {
            enum_type: "MavResult",
            value: u64::from(value),
        })?;
        Ok(Self {
            command: payload.u16(0),
            result,
            target_system: payload.u8(TARGET_SYSTEM_AT),
            target_component: payload.u8(TARGET_SYSTEM_AT + 1),
        })
    }
}

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
