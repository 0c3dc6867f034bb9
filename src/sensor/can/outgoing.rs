//! Transfers that are sent, as frames.

use core::iter;

use heapless::{Deque, Vec};

use super::assembler::SignatureCrc;
use super::frame::{CanFrame, FRAME_BYTES, Identifier, Priority, Tail};

/// Frames that can wait. The longest transfer has 9.
const FRAMES: usize = 20;

/// The longest payload, of a response with what this node is, and its CRC.
const LONGEST_BYTES: usize = 64;

const PART_BYTES: usize = FRAME_BYTES - 1;

/// A transfer to be sent.
#[derive(Debug)]
pub(super) struct Transfer<'a> {
    pub identifier: Identifier,
    pub priority: Priority,
    /// Counts transfers of the type; its lowest five bits are sent.
    pub transfer_id: u8,
    pub crc: SignatureCrc,
    pub payload: &'a [u8],
}

/// Frames that wait to be sent.
#[derive(Debug)]
pub(super) struct Outgoing {
    frames: Deque<CanFrame, FRAMES>,
    dropped: u32,
}

impl Outgoing {
    /// Without any frame.
    pub const EMPTY: Self = Self {
        frames: Deque::new(),
        dropped: 0,
    };

    /// Adds the frames of a transfer, or none of them if they do not all fit.
    pub fn send(&mut self, transfer: &Transfer) {
        if self.add(transfer).is_none() {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// The frame that waits the longest.
    pub fn next(&mut self) -> Option<CanFrame> {
        self.frames.pop_front()
    }

    /// Transfers that did not fit.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    fn add(&mut self, transfer: &Transfer) -> Option<()> {
        let content = content(transfer)?;
        let id = transfer.identifier.with_priority(transfer.priority);
        let count = content.len().div_ceil(PART_BYTES).max(1);
        if self.frames.len() + count > FRAMES {
            return None;
        }
        // Without any content there is one frame, too.
        let parts = content
            .chunks(PART_BYTES)
            .chain(iter::repeat(&[][..]))
            .take(count);
        for (index, part) in parts.enumerate() {
            let mut data: Vec<u8, FRAME_BYTES> = Vec::new();
            data.extend_from_slice(part).ok()?;
            data.push(Tail::of_frame(index, count, transfer.transfer_id).0)
                .ok()?;
            self.frames.push_back(CanFrame::new(id, &data)?).ok()?;
        }
        Some(())
    }
}

/// What is divided into frames: the payload, with its CRC in front if it needs several.
fn content(transfer: &Transfer) -> Option<Vec<u8, LONGEST_BYTES>> {
    let mut content = Vec::new();
    if transfer.payload.len() > PART_BYTES {
        let crc = transfer.crc.of_transfer(transfer.payload);
        content.extend_from_slice(&crc.to_le_bytes()).ok()?;
    }
    content.extend_from_slice(transfer.payload).ok()?;
    Some(content)
}
