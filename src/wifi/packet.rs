//! Packets that come from the radio's chip: a header of the bus (SDPCM), one of the channel, and what is in it.
//!
//! The driver trusts the lengths in them. What comes over a loose wire, or from a chip that is upset, is checked before.

/// Length, inverted length, sequence, channel, next length, length of this header, flow control, credit, 2 reserved bytes.
const BUS_HEADER_BYTES: usize = 12;
/// Command (4), length (4), flags (2), id (2), status (4).
const CONTROL_HEADER_BYTES: usize = 16;
/// Flags, priority, more flags, length of what follows before the frame, in words.
const DATA_HEADER_BYTES: usize = 4;

/// Offset of the channel's number.
const CHANNEL: usize = 5;
const CHANNEL_MASK: u8 = 0x0f;
/// Answers to control requests.
const CONTROL: u8 = 0;
/// Channel of events, which the chip reports unasked.
const EVENT: u8 = 1;
/// Frames from the air.
const DATA: u8 = 2;
/// Offset of the bus header's length.
const HEADER_LENGTH: usize = 7;

/// Offset of the status in an answer to a control request.
const STATUS: usize = 12;

/// An event's frame: 14 bytes of Ethernet, 10 of Broadcom's, then its message: version (2), flags (2), kind (4), status (4).
const EVENT_FLAGS: usize = 26;
const EVENT_KIND: usize = 28;
const EVENT_END: usize = 36;

/// Kinds of events (Broadcom's `bcmevent.h`): the other side has ended the authentication, this side or the other the
/// association; the link has changed.
const DEAUTH_IND: u32 = 6;
const DISASSOC: u32 = 11;
const DISASSOC_IND: u32 = 12;
const LINK: u32 = 16;

/// The largest Ethernet frame that the driver has room for, in bytes.
const MAX_FRAME_BYTES: usize = 1514;

/// The chip does not do what was asked, or there is no sense in its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum PacketFault {
    /// The lengths contradict each other.
    Malformed,
    /// A frame that is longer than Ethernet's.
    TooLong,
    /// A control request was refused, with the chip's error code.
    Refused(i32),
}

/// A packet that the driver may see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacketKind {
    /// An event: a station is no longer in its network, or a client has left the access point.
    Exclusion,
    /// Any other.
    Other,
}

/// Checks a packet of `length` bytes, in words as they were read.
///
/// # Errors
/// The driver must not see it: it would take the lengths for granted, or give up.
pub fn check_packet(words: &[u32], length: usize) -> Result<PacketKind, PacketFault> {
    let packet = Packet { words, length };
    packet.check().unwrap_or(Err(PacketFault::Malformed))
}

/// Makes of a refused control request one that was done: the driver would panic.
pub fn hide_refusal(words: &mut [u32]) {
    let start = payload_start(words);
    (start + STATUS..start + CONTROL_HEADER_BYTES).for_each(|at| put(words, at, 0));
}

/// Makes of an [exclusion](PacketKind::Exclusion) the event that the link is down, the only one by which the driver lowers it.
pub fn lower_link(words: &mut [u32]) {
    let packet = Packet {
        words,
        length: usize::MAX,
    };
    let start = packet.event_start().unwrap_or(usize::MAX / 2);
    (start + EVENT_FLAGS..start + EVENT_END).for_each(|at| put(words, at, 0));
    put(words, start + EVENT_KIND + 3, LINK as u8);
}

/// Behind the header of the bus.
fn payload_start(words: &[u32]) -> usize {
    let packet = Packet {
        words,
        length: usize::MAX,
    };
    packet.byte(HEADER_LENGTH).map_or(0, usize::from)
}

fn put(words: &mut [u32], at: usize, byte: u8) {
    if let Some(word) = words.get_mut(at / 4) {
        let mut bytes = word.to_le_bytes();
        if let Some(place) = bytes.get_mut(at % 4) {
            *place = byte;
        }
        *word = u32::from_le_bytes(bytes);
    }
}

/// The present part of a packet.
struct Packet<'a> {
    words: &'a [u32],
    length: usize,
}

impl Packet<'_> {
    /// `None` if it ends before what has to be there.
    fn check(&self) -> Option<Result<PacketKind, PacketFault>> {
        let length = self.half(0)?;
        let header_bytes = usize::from(self.byte(HEADER_LENGTH)?);
        if length != !self.half(2)? || usize::from(length) != self.length || header_bytes < BUS_HEADER_BYTES {
            return None;
        }
        let payload_bytes = self.length.checked_sub(header_bytes)?;
        match self.byte(CHANNEL)? & CHANNEL_MASK {
            CONTROL if payload_bytes >= CONTROL_HEADER_BYTES => {
                self.check_answer(header_bytes, payload_bytes)
            }
            DATA if payload_bytes >= DATA_HEADER_BYTES => self.check_frame(header_bytes, payload_bytes),
            EVENT if self.is_exclusion() => Some(Ok(PacketKind::Exclusion)),
            // The driver looks at the lengths of all others itself, or ignores them.
            _ => Some(Ok(PacketKind::Other)),
        }
    }

    /// The answer to a control request.
    fn check_answer(&self, start: usize, bytes: usize) -> Option<Result<PacketKind, PacketFault>> {
        let response_bytes = self.word(start + 4)? as usize;
        bytes
            .checked_sub(CONTROL_HEADER_BYTES)?
            .checked_sub(response_bytes)?;
        Some(match self.word(start + STATUS)? {
            0 => Ok(PacketKind::Other),
            status => Err(PacketFault::Refused(status.cast_signed())),
        })
    }

    /// A frame from the air.
    fn check_frame(&self, start: usize, bytes: usize) -> Option<Result<PacketKind, PacketFault>> {
        let offset_bytes = 4 * usize::from(self.byte(start + 3)?);
        let frame_bytes = bytes.saturating_sub(DATA_HEADER_BYTES + offset_bytes);
        Some(if frame_bytes > MAX_FRAME_BYTES {
            Err(PacketFault::TooLong)
        } else {
            Ok(PacketKind::Other)
        })
    }

    /// Offset of an event's frame.
    fn event_start(&self) -> Option<usize> {
        let start = usize::from(self.byte(HEADER_LENGTH)?);
        Some(start + DATA_HEADER_BYTES + 4 * usize::from(self.byte(start + 3)?))
    }

    fn is_exclusion(&self) -> bool {
        let kind = self.event_start().and_then(|start| {
            // All of the event has to be there.
            self.word(start + EVENT_END - 4)?;
            self.word(start + EVENT_KIND)
        });
        // The network's order.
        let kind = kind.map(u32::swap_bytes);
        matches!(kind, Some(DEAUTH_IND | DISASSOC | DISASSOC_IND))
    }

    /// The chip's bytes are in words, lowest first.
    fn byte(&self, at: usize) -> Option<u8> {
        let word = self.words.get(at / 4).filter(|_| at < self.length)?;
        word.to_le_bytes().get(at % 4).copied()
    }

    fn half(&self, at: usize) -> Option<u16> {
        Some(u16::from_le_bytes([self.byte(at)?, self.byte(at + 1)?]))
    }

    fn word(&self, at: usize) -> Option<u32> {
        let [low, high] = [self.half(at)?, self.half(at + 2)?];
        Some(u32::from(high) << 16 | u32::from(low))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn words_of(packet: &[u8]) -> Vec<u32> {
        let mut padded = packet.to_vec();
        padded.resize(packet.len().next_multiple_of(4), 0);
        let words = padded.chunks(4);
        words
            .map(|word| u32::from_le_bytes(word.try_into().unwrap()))
            .collect()
    }

    fn check_packet(packet: &[u8]) -> Result<(), PacketFault> {
        super::check_packet(&words_of(packet), packet.len()).map(drop)
    }

    /// An event of this kind, 8 bytes behind the headers.
    fn event(kind: u32) -> Vec<u8> {
        let mut frame = vec![0; EVENT_KIND];
        frame[EVENT_FLAGS + 1] = 1;
        frame.extend(kind.to_be_bytes());
        frame.extend([0, 0, 0, 9, 0, 0, 0, 7]);
        packet(
            EVENT,
            &[&[0x20, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0][..], &frame].concat(),
        )
    }

    /// A packet with right lengths.
    fn packet(channel: u8, payload: &[u8]) -> Vec<u8> {
        let length = (BUS_HEADER_BYTES + payload.len()) as u16;
        let mut packet = [length.to_le_bytes(), (!length).to_le_bytes()].concat();
        packet.extend([0, channel, 0, BUS_HEADER_BYTES as u8, 0, 0, 0, 0]);
        packet.extend(payload);
        packet
    }

    fn answer(length: u32, status: i32, response: &[u8]) -> Vec<u8> {
        let mut payload = 263_u32.to_le_bytes().to_vec();
        payload.extend(length.to_le_bytes());
        payload.extend([0; 4]);
        payload.extend(status.to_le_bytes());
        payload.extend(response);
        packet(CONTROL, &payload)
    }

    #[test]
    fn answer_with_its_right_length_passes() {
        assert_eq!(check_packet(&answer(4, 0, &[1, 2, 3, 4])), Ok(()));
        assert_eq!(check_packet(&answer(2, 0, &[1, 2, 3, 4])), Ok(()), "padding");
    }

    #[test]
    fn answer_that_claims_more_than_there_is_does_not_pass() {
        assert_eq!(
            check_packet(&answer(5, 0, &[1, 2, 3, 4])),
            Err(PacketFault::Malformed)
        );
        assert_eq!(
            check_packet(&answer(u32::MAX, 0, &[])),
            Err(PacketFault::Malformed)
        );
    }

    #[test]
    fn refusal_has_the_chips_code() {
        assert_eq!(check_packet(&answer(0, -23, &[])), Err(PacketFault::Refused(-23)));
    }

    #[test]
    fn frame_passes_up_to_ethernets_length() {
        for (bytes, expected) in [(0, Ok(())), (1514, Ok(())), (1515, Err(PacketFault::TooLong))] {
            let mut payload = vec![0x20, 0, 0, 0];
            payload.extend(vec![0; bytes]);
            assert_eq!(check_packet(&packet(DATA, &payload)), expected, "{bytes}");
        }
        // Bytes between the header and the frame do not count.
        let mut payload = vec![0x20, 0, 0, 2];
        payload.extend(vec![0; 8 + 1514]);
        assert_eq!(check_packet(&packet(DATA, &payload)), Ok(()));
    }

    #[test]
    fn contradicting_lengths_do_not_pass() {
        let good = packet(EVENT, &[0; 20]);
        assert_eq!(check_packet(&good), Ok(()));
        let malformed = Err(PacketFault::Malformed);
        for (at, value) in [(0, 0), (2, 0), (7, 11), (7, 33)] {
            let mut bad = good.clone();
            bad[at] = value;
            assert_eq!(check_packet(&bad), malformed, "byte {at}");
        }
        assert_eq!(check_packet(&good[..good.len() - 1]), malformed);
        assert_eq!(check_packet(&[]), malformed);
    }

    #[test]
    fn hidden_refusal_is_an_answer_like_any_other() {
        let mut words = words_of(&answer(0, -1, &[]));
        hide_refusal(&mut words);
        assert_eq!(words, words_of(&answer(0, 0, &[])));
    }

    #[test]
    fn exclusion_becomes_a_link_that_is_down_and_nothing_else() {
        for kind in [DEAUTH_IND, DISASSOC, DISASSOC_IND] {
            let bytes = event(kind);
            let mut words = words_of(&bytes);
            assert_eq!(
                super::check_packet(&words, bytes.len()),
                Ok(PacketKind::Exclusion)
            );
            lower_link(&mut words);
            let mut lowered = event(LINK);
            let start = bytes.len() - EVENT_KIND - 12;
            lowered[start + EVENT_FLAGS..start + EVENT_KIND].fill(0);
            lowered[start + EVENT_END - 4..start + EVENT_END].fill(0);
            assert_eq!(words, words_of(&lowered), "{kind}");
        }
        for kind in [5, 7, LINK, DISASSOC << 8] {
            let bytes = event(kind);
            assert_eq!(
                super::check_packet(&words_of(&bytes), bytes.len()),
                Ok(PacketKind::Other)
            );
        }
        // A packet that ends before its status is none.
        let cut = event(DEAUTH_IND);
        let cut = packet(EVENT, &cut[BUS_HEADER_BYTES..cut.len() - 5]);
        assert_eq!(
            super::check_packet(&words_of(&cut), cut.len()),
            Ok(PacketKind::Other)
        );
    }

    proptest! {
        /// The driver's use of a packet's lengths stays inside of it.
        #[test]
        fn what_passes_has_its_parts_inside(packet in proptest::collection::vec(any::<u8>(), 0..64), fix in any::<bool>()) {
            let mut packet = packet;
            if fix && packet.len() >= 8 {
                let length = packet.len() as u16;
                packet[..2].copy_from_slice(&length.to_le_bytes());
                packet[2..4].copy_from_slice(&(!length).to_le_bytes());
            }
            // Nor does what is made of a packet.
            let mut words = words_of(&packet);
            hide_refusal(&mut words);
            lower_link(&mut words);
            if check_packet(&packet).is_ok() {
                let payload = &packet[usize::from(packet[7])..];
                prop_assert!(usize::from(packet[7]) >= BUS_HEADER_BYTES);
                if packet[5] & 0x0f == CONTROL && payload.len() >= CONTROL_HEADER_BYTES {
                    let length = u32::from_le_bytes(payload[4..8].try_into().unwrap());
                    prop_assert!(payload.len() - CONTROL_HEADER_BYTES >= length as usize);
                }
            }
        }
    }
}
