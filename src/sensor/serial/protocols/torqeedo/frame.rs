//! Frames of the TQ bus: header, content, CRC-8 (Maxim) of the content, footer. In between, bytes that look like a header,
//! footer or escape follow an escape, with their highest bit inverted.

use crc::{CRC_8_MAXIM_DOW, Crc, NoTable};

/// Without a table, as of contents of a few bytes.
const CRC: Crc<u8, NoTable> = Crc::<u8, NoTable>::new(&CRC_8_MAXIM_DOW);

const HEADER: u8 = 0xAC;
const FOOTER: u8 = 0xAD;
const ESCAPE: u8 = 0xAE;
const ESCAPE_MASK: u8 = 0x80;

/// Most bytes of a content with its checksum, as ArduPilot's limit.
pub(super) const CONTENT_BYTES: usize = 35;

/// Finds frames in what is received.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameReader {
    content: [u8; CONTENT_BYTES],
    length: usize,
    position: Position,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Position {
    Outside,
    Inside,
    AfterEscape,
}

impl FrameReader {
    /// Outside a frame.
    pub const fn new() -> Self {
        Self {
            content: [0; CONTENT_BYTES],
            length: 0,
            position: Position::Outside,
        }
    }

    /// Whether a frame has begun.
    pub fn is_inside(&self) -> bool {
        self.position != Position::Outside
    }

    /// Takes a byte, and returns the content without its checksum if it completes a valid frame.
    pub fn push(&mut self, byte: u8) -> Option<&[u8]> {
        match (self.position, byte) {
            // Neither is part of a content: whatever was before, a frame begins or ends here.
            (_, HEADER) => {
                self.position = Position::Inside;
                self.length = 0;
                None
            }
            (Position::Inside, FOOTER) => {
                self.position = Position::Outside;
                self.checked()
            }
            (_, FOOTER) => {
                self.position = Position::Outside;
                None
            }
            (Position::Outside, _) => None,
            (Position::Inside, ESCAPE) => {
                self.position = Position::AfterEscape;
                None
            }
            (Position::AfterEscape, byte) => {
                self.position = Position::Inside;
                self.add(byte ^ ESCAPE_MASK);
                None
            }
            (Position::Inside, byte) => {
                self.add(byte);
                None
            }
        }
    }

    fn add(&mut self, byte: u8) {
        match self.content.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length += 1;
            }
            // Longer than any frame.
            None => self.position = Position::Outside,
        }
    }

    fn checked(&self) -> Option<&[u8]> {
        let (crc, content) = self.content.get(..self.length)?.split_last()?;
        (!content.is_empty() && CRC.checksum(content) == *crc).then_some(content)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The frame of a content.
    pub fn frame(content: &[u8]) -> Vec<u8> {
        let mut frame = vec![HEADER];
        for byte in content.iter().copied().chain([CRC.checksum(content)]) {
            if matches!(byte, HEADER | FOOTER | ESCAPE) {
                frame.extend([ESCAPE, byte ^ ESCAPE_MASK]);
            } else {
                frame.push(byte);
            }
        }
        frame.push(FOOTER);
        frame
    }

    fn read(reader: &mut FrameReader, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        for byte in bytes {
            found.extend(reader.push(*byte).map(<[u8]>::to_vec));
        }
        found
    }

    #[test]
    fn frames_are_those_of_a_tiller() {
        // The examples of a turned handle in ArduPilot's libraries/AP_Torqeedo/AP_Torqeedo_TQBus.cpp; of the second, the byte
        // behind the escape is 0x2C: it is 0xAC, not the 0xAE of its comment.
        let ahead = [0xAC, 0x00, 0x00, 0x05, 0x00, 0x00, 0xED, 0x95, 0xAD];
        assert_eq!(frame(&[0, 0, 5, 0, 0x00, 0xED]), ahead);
        let back = [0xAC, 0x00, 0x00, 0x05, 0x00, 0xFF, 0xAE, 0x2C, 0x0C, 0xAD];
        assert_eq!(frame(&[0, 0, 5, 0, 0xFF, 0xAC]), back);
        let mut reader = FrameReader::new();
        assert_eq!(read(&mut reader, &ahead), [[0, 0, 5, 0, 0x00, 0xED]]);
        assert_eq!(read(&mut reader, &back), [[0, 0, 5, 0, 0xFF, 0xAC]]);
    }

    #[test]
    fn checksum_is_that_of_the_catalogue() {
        // CRC-8/MAXIM-DOW's check value.
        assert_eq!(CRC.checksum(b"123456789"), 0xA1);
    }

    #[test]
    fn too_long_or_empty_is_no_frame() {
        let mut reader = FrameReader::new();
        let longest = vec![0; CONTENT_BYTES - 1];
        assert_eq!(read(&mut reader, &frame(&longest)), [longest]);
        let long = [&[HEADER][..], &[0; CONTENT_BYTES + 1], &[FOOTER]].concat();
        assert_eq!(read(&mut reader, &long), Vec::<Vec<u8>>::new());
        assert_eq!(read(&mut reader, &[HEADER, FOOTER]), Vec::<Vec<u8>>::new());
        assert_eq!(read(&mut reader, &[HEADER, 0, FOOTER]), Vec::<Vec<u8>>::new());
    }

    proptest! {
        #[test]
        fn frame_is_found_right_after_garbage(
            garbage in prop::collection::vec(any::<u8>(), 0..100),
            content in prop::collection::vec(any::<u8>(), 1..CONTENT_BYTES),
        ) {
            let mut reader = FrameReader::new();
            read(&mut reader, &garbage);
            let found = read(&mut reader, &frame(&content));
            prop_assert_eq!(found, [content]);
        }

        #[test]
        fn frame_with_a_wrong_byte_is_not_found(
            content in prop::collection::vec(any::<u8>(), 1..CONTENT_BYTES),
            place: prop::sample::Index,
            change in 1..=u8::MAX,
        ) {
            let mut bytes = frame(&content);
            let place = place.index(bytes.len());
            bytes[place] ^= change;
            let found = read(&mut FrameReader::new(), &bytes);
            // A new header or escape can make another frame of what is left; its checksum lets one in 256 pass.
            let is_shorter = |found: &Vec<u8>| found.len() != content.len();
            prop_assert!(found.iter().all(is_shorter), "{:?}", found);
        }
    }
}
