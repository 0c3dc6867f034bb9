//! Packets that come from the radio's chip: a header of the bus (SDPCM), one of the channel, and what is in it.
//!
//! The driver trusts the lengths in them. What comes over a loose wire, or from a chip that is upset, is checked before.

/// Length, inverted length, sequence, channel, next length, length of this header, flow control, credit, 2 reserved bytes.
const BUS_HEADER_BYTES: usize = 12;
/// Command (4), length (4), flags (2), id (2), status (4).
const CONTROL_HEADER_BYTES: usize = 16;
/// Flags, priority, more flags, length of what follows before the frame, in words.
const DATA_HEADER_BYTES: usize = 4;

/// Where a channel's number is.
const CHANNEL: usize = 5;
const CHANNEL_MASK: u8 = 0x0f;
/// Answers to control requests.
const CONTROL: u8 = 0;
/// Frames from the air.
const DATA: u8 = 2;
/// Where the length of the bus header is.
const HEADER_LENGTH: usize = 7;

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

/// Checks a packet of `length` bytes, in words as they were read.
///
/// # Errors
/// The driver must not see it: it would take the lengths for granted, or give up.
pub fn check_packet(words: &[u32], length: usize) -> Result<(), PacketFault> {
    let packet = Packet { words, length };
    packet.check().unwrap_or(Err(PacketFault::Malformed))
}

/// What there is of a packet.
struct Packet<'a> {
    words: &'a [u32],
    length: usize,
}

impl Packet<'_> {
    /// `None` if it ends before what has to be there.
    fn check(&self) -> Option<Result<(), PacketFault>> {
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
            // The driver looks at the lengths of all others itself, or ignores them.
            _ => Some(Ok(())),
        }
    }

    /// The answer to a control request.
    fn check_answer(&self, start: usize, bytes: usize) -> Option<Result<(), PacketFault>> {
        let response_bytes = self.word(start + 4)? as usize;
        bytes
            .checked_sub(CONTROL_HEADER_BYTES)?
            .checked_sub(response_bytes)?;
        Some(match self.word(start + 12)? {
            0 => Ok(()),
            status => Err(PacketFault::Refused(status.cast_signed())),
        })
    }

    /// A frame from the air.
    fn check_frame(&self, start: usize, bytes: usize) -> Option<Result<(), PacketFault>> {
        let offset_bytes = 4 * usize::from(self.byte(start + 3)?);
        let frame_bytes = bytes.saturating_sub(DATA_HEADER_BYTES + offset_bytes);
        Some(if frame_bytes > MAX_FRAME_BYTES {
            Err(PacketFault::TooLong)
        } else {
            Ok(())
        })
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

    const EVENT: u8 = 1;

    fn check_packet(packet: &[u8]) -> Result<(), PacketFault> {
        let mut padded = packet.to_vec();
        padded.resize(packet.len().next_multiple_of(4), 0);
        let words = padded.chunks(4);
        let words: Vec<u32> = words
            .map(|word| u32::from_le_bytes(word.try_into().unwrap()))
            .collect();
        super::check_packet(&words, packet.len())
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
        // What stands between the header and the frame does not count.
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

    proptest! {
        /// What the driver does with a packet's lengths stays inside of it.
        #[test]
        fn what_passes_has_its_parts_inside(packet in proptest::collection::vec(any::<u8>(), 0..64), fix in any::<bool>()) {
            let mut packet = packet;
            if fix && packet.len() >= 8 {
                let length = packet.len() as u16;
                packet[..2].copy_from_slice(&length.to_le_bytes());
                packet[2..4].copy_from_slice(&(!length).to_le_bytes());
            }
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
