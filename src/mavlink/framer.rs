//! From a message to the bytes of a frame.

use ::mavlink::{MAVLinkV2MessageRaw, MavHeader};

use super::{COMPONENT_ID, Message};

/// Makes the frames of one link and numbers them.
///
/// The sequence number is given here, at the wire, and not when a message is built: a message dropped on the way leaves
/// no gap, so a gap a ground station counts is one the wire made.
#[derive(Debug, Default)]
pub struct Framer {
    next_sequence: u8,
    frame: MAVLinkV2MessageRaw,
}

impl Framer {
    /// A framer whose first frame has sequence number 0.
    pub fn new() -> Self {
        Self::default()
    }

    /// The MAVLink 2 frame of `message`, sent by `system_id`.
    pub fn frame(&mut self, message: &Message, system_id: u8) -> &[u8] {
        let header = MavHeader {
            system_id: u32::from(system_id),
            component_id: COMPONENT_ID,
            sequence: self.next_sequence,
        };
        self.next_sequence = self.next_sequence.wrapping_add(1);
        message.serialize(header, &mut self.frame);
        self.frame.raw_bytes()
    }
}
