//! From a message to the bytes of a frame.

use ::mavlink::{MAVLinkV2MessageRaw, MavHeader};

use super::parser::FLAG_SIGNED;
use super::signing::{LinkKind, Signing};
use super::{COMPONENT_ID, ToFrame};
use crate::time::Instant;

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

    /// A framer whose first frame has this sequence number.
    pub fn starting_at(sequence: u8) -> Self {
        Self {
            next_sequence: sequence,
            ..Self::default()
        }
    }

    /// The sequence number of the next frame.
    pub fn next_sequence(&self) -> u8 {
        self.next_sequence
    }

    /// The MAVLink 2 frame of `message`, sent by `system_id`, not signed.
    pub fn frame(&mut self, message: &impl ToFrame, system_id: u8) -> &[u8] {
        self.serialize(message, system_id, 0);
        self.frame.raw_bytes()
    }

    /// The MAVLink 2 frame of `message`, sent by `system_id` on a link of this kind at `now`; signed if there is a key.
    pub fn signed_frame(
        &mut self,
        message: &impl ToFrame,
        system_id: u8,
        signing: &mut Signing,
        link: LinkKind,
        now: Instant,
    ) -> &[u8] {
        if !signing.signs() {
            return self.frame(message, system_id);
        }
        self.serialize(message, system_id, FLAG_SIGNED);
        let frame_bytes = self.frame.raw_bytes().len();
        if let Some(frame) = self.frame.as_mut_slice().get_mut(..frame_bytes) {
            signing.sign(frame, link, now);
        }
        self.frame.raw_bytes()
    }

    fn serialize(&mut self, message: &impl ToFrame, system_id: u8, flags: u8) {
        let header = MavHeader {
            system_id: u32::from(message.sender_system().unwrap_or(system_id)),
            component_id: COMPONENT_ID,
            sequence: self.next_sequence,
        };
        self.next_sequence = self.next_sequence.wrapping_add(1);
        *self.frame.incompatibility_flags_mut() = flags;
        message.serialize(header, &mut self.frame);
    }
}
