//! Transfers from frames, and frames of those that are sent. Their CRC is CRC-16/CCITT-FALSE over the signature of the data type and the payload.

use core::iter;

use crc::{CRC_16_IBM_3740, Crc, NoTable};
use heapless::{Deque, Vec};

use super::MAX_NODES;
use super::frame::{CanFrame, FRAME_BYTES, Identifier, Priority, Tail};
use crate::time::Instant;

/// Without a table, which would take 512 bytes: a battery's transfer takes some 50 µs.
const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_IBM_3740);

/// The CRC of a data type's signature, with which that of its transfers begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SignatureCrc(u16);

impl SignatureCrc {
    /// Of a signature.
    pub const fn of(signature: u64) -> Self {
        Self(CRC.checksum(&signature.to_le_bytes()))
    }

    /// The CRC of a transfer.
    pub fn of_transfer(self, payload: &[u8]) -> u16 {
        // This CRC is neither reflected nor inverted, so it goes on from where another has ended.
        let mut digest = CRC.digest_with_initial(self.0);
        digest.update(payload);
        digest.finalize()
    }
}

/// Transfers that can be incomplete at a time. Nodes interleave theirs; each frame of a transfer follows within milliseconds.
const SLOTS: usize = MAX_NODES;

/// The longest payload: a BatteryInfoAux of 31 cells.
const LONGEST_PAYLOAD_BYTES: usize = 80;

/// A transfer of several frames begins with its CRC.
const CRC_BYTES: usize = 2;

/// Data of a frame that is not the last one.
const PART_BYTES: usize = FRAME_BYTES - 1;

/// A transfer whose next frame does not come within this time is lost, in microseconds (DroneCAN specification,
/// 4. CAN bus transport layer: recommended transfer-id timeout).
const TIMEOUT_US: u64 = 2_000_000;

/// Puts transfers together.
#[derive(Debug)]
pub(super) struct Assembler {
    slots: [Slot; SLOTS],
    lost: u32,
}

#[derive(Debug)]
struct Slot {
    /// Source and type of the transfer, while there is one.
    key: Option<u32>,
    /// When its latest frame was received.
    heard: Instant,
    transfer_id: u8,
    /// Toggle of the next frame.
    toggle: bool,
    length: usize,
    bytes: [u8; CRC_BYTES + LONGEST_PAYLOAD_BYTES],
}

impl Slot {
    const EMPTY: Self = Self {
        key: None,
        heard: Instant::EPOCH,
        transfer_id: 0,
        toggle: false,
        length: 0,
        bytes: [0; CRC_BYTES + LONGEST_PAYLOAD_BYTES],
    };

    fn append(&mut self, part: &[u8]) -> Option<()> {
        let end = self.length + part.len();
        self.bytes.get_mut(self.length..end)?.copy_from_slice(part);
        self.length = end;
        Some(())
    }

    fn received(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }

    /// Takes the next frame; `None` if it does not continue the transfer, which ends then.
    fn continue_with(&mut self, tail: Tail, part: &[u8], now: Instant) -> Option<()> {
        let is_late = now.us_since(self.heard) > TIMEOUT_US;
        let is_whole = tail.is_end() || part.len() == PART_BYTES;
        if is_late || !is_whole || tail.transfer_id() != self.transfer_id || tail.toggle() != self.toggle {
            return None;
        }
        self.append(part)?;
        self.heard = now;
        self.toggle = !self.toggle;
        Some(())
    }

    /// Whether it is the latest frame once more: its sender may have missed that it was received.
    fn is_repeated(&self, tail: Tail, part: &[u8]) -> bool {
        tail.transfer_id() == self.transfer_id
            && tail.toggle() != self.toggle
            && self.received().ends_with(part)
    }

    fn payload(&self, crc: SignatureCrc) -> Option<&[u8]> {
        let (sent, payload) = self.received().split_first_chunk()?;
        (crc.of_transfer(payload) == u16::from_le_bytes(*sent)).then_some(payload)
    }
}

impl Assembler {
    /// Without any transfer.
    pub const EMPTY: Self = Self {
        slots: [Slot::EMPTY; SLOTS],
        lost: 0,
    };

    /// Takes the data of a frame. Returns the payload of the transfer that it completes.
    ///
    /// `key` is what all transfers of the same source and type have in common: there is one of them at a time.
    pub fn push<'a>(
        &'a mut self,
        key: u32,
        crc: SignatureCrc,
        data: &'a [u8],
        now: Instant,
    ) -> Option<&'a [u8]> {
        let (tail, part) = data.split_last()?;
        let tail = Tail(*tail);
        match (tail.is_start(), tail.is_end()) {
            // A set toggle at the start is another protocol, Cyphal.
            (true, _) if tail.toggle() => None,
            (true, true) => Some(part),
            (true, false) => {
                self.begin(key, tail, part, now);
                None
            }
            (false, _) => self.proceed(key, crc, tail, part, now),
        }
    }

    /// Transfers that were begun and not received whole.
    pub fn lost(&self) -> u32 {
        self.lost
    }

    fn begin(&mut self, key: u32, tail: Tail, part: &[u8], now: Instant) {
        if part.len() != PART_BYTES {
            return;
        }
        // That of the same key, else a free one, else the one that has waited the longest.
        let rank = |slot: &&mut Slot| match slot.key {
            Some(other) if other == key => (0, Instant::EPOCH),
            None => (1, Instant::EPOCH),
            Some(_) => (2, slot.heard),
        };
        let Some(slot) = self.slots.iter_mut().min_by_key(rank) else {
            return;
        };
        if slot.key.is_some() {
            self.lost = self.lost.saturating_add(1);
        }
        slot.key = Some(key);
        slot.heard = now;
        slot.transfer_id = tail.transfer_id();
        slot.toggle = true;
        slot.length = 0;
        // It fits.
        let _ = slot.append(part);
    }

    fn proceed(
        &mut self,
        key: u32,
        crc: SignatureCrc,
        tail: Tail,
        part: &[u8],
        now: Instant,
    ) -> Option<&[u8]> {
        let slot = self.slots.iter_mut().find(|slot| slot.key == Some(key))?;
        if slot.is_repeated(tail, part) {
            return None;
        }
        let is_broken = slot.continue_with(tail, part, now).is_none();
        if !is_broken && !tail.is_end() {
            return None;
        }
        slot.key = None;
        let payload = slot.payload(crc).filter(|_| !is_broken);
        if payload.is_none() {
            self.lost = self.lost.saturating_add(1);
        }
        payload
    }
}

/// Frames that can wait. The longest transfer has 9.
const FRAMES: usize = 20;

/// The longest payload, of a response with what this node is, and its CRC.
const LONGEST_BYTES: usize = 64;

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

/// Bytes to divide into frames: the payload, with its CRC in front if it needs several.
fn content(transfer: &Transfer) -> Option<Vec<u8, LONGEST_BYTES>> {
    let mut content = Vec::new();
    if transfer.payload.len() > PART_BYTES {
        let crc = transfer.crc.of_transfer(transfer.payload);
        content.extend_from_slice(&crc.to_le_bytes()).ok()?;
    }
    content.extend_from_slice(transfer.payload).ok()?;
    Some(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `base_crc` of the data types in PyPI `dronecan` 1.0.27.
    #[test]
    fn signatures_have_the_crc_of_the_reference() {
        for (signature, crc) in [
            (0x249c_2654_8a71_1966, 0xf674),
            (0x7d7f_49fc_7548_4882, 0xb0c5),
            (0xdd70_96b2_55fb_6358, 0x2fca),
            (0x0b2a_8126_20a1_1d40, 0xf258),
        ] {
            assert_eq!(SignatureCrc::of(signature), SignatureCrc(crc));
        }
    }
}
