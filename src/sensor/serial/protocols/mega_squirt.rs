//! Engine control units that speak MegaSquirt's protocol (MS2/Extra from 3.3, MS3 from 1.2), which is in ArduPilot's
//! AP_EFI_Serial_MS, and in the "Megasquirt serial protocol" of msextra.com.
//!
//! A request and its answer are wrapped alike: length (2 bytes), content, CRC-32 of the content; all big-endian. The answer's
//! content begins with 0 if the unit could answer. Of table 7, the real-time data, these bytes are requested:
//!
//! | byte | content |
//! |---|---|
//! | 2, 3 | duration of an injection, in µs |
//! | 4, 5 | that of the second bank, not used |
//! | 6, 7 | speed, in revolutions per minute |

use super::super::protocol::{Baud, Line, Protocol, Request, SerialReading, Wires};
use crate::battery::ReadError;
use crate::memory::checksum::file_crc32;
use crate::parameter::MonitorKind;
use crate::sensor::EngineReading;
use crate::time::Instant;

/// Command `r` (read) to unit 0: table 7, from byte 2, 6 bytes.
const REQUEST: [u8; 13] = [
    0x00, 0x07, b'r', 0x00, 0x07, 0x00, 0x02, 0x00, 0x06, 0xBE, 0x5C, 0xB3, 0x37,
];

const ANSWER_BYTES: usize = 13;

/// Length of the answer's content, and that it is an answer.
const ANSWER_START: [u8; 3] = [0x00, 0x07, 0x00];

/// Interval of requests to the unit, in microseconds: in each sampling tick.
const INTERVAL_US: u64 = 100_000;

/// MegaSquirt's protocol.
#[derive(Clone, Copy, Debug)]
pub(in crate::sensor::serial) struct MegaSquirt {
    /// The latest `length` bytes.
    window: [u8; ANSWER_BYTES],
    length: usize,
    request_due: Instant,
}

impl Protocol for MegaSquirt {
    type Model = ();
    const LINE: Line = Line {
        baud: Baud::Fixed(115_200),
        wires: Wires::BothWays,
    };
    const KINDS: &'static [MonitorKind] = &[MonitorKind::Efi];
    const TIMEOUT_US: u64 = 1_000_000;

    fn new((): &()) -> Self {
        Self {
            window: [0; ANSWER_BYTES],
            length: 0,
            request_due: Instant::EPOCH,
        }
    }

    /// The rest of an answer is dropped with the next request: the unit may pause within one.
    fn push(&mut self, byte: u8, _: Instant, deliver: &mut impl FnMut(SerialReading)) {
        match self.take(byte) {
            Some(Ok(reading)) => deliver(SerialReading::Efi(reading)),
            Some(Err(error)) => deliver(SerialReading::Refused(MonitorKind::Efi, error)),
            None => {}
        }
    }

    fn next_request(&mut self, now: Instant) -> Option<Request> {
        if now < self.request_due {
            return None;
        }
        self.request_due = now.after_us(INTERVAL_US);
        self.length = 0;
        Request::from_slice(&REQUEST).ok()
    }

    fn next_due(&self) -> Option<Instant> {
        Some(self.request_due)
    }
}

impl MegaSquirt {
    /// Takes a byte, and returns the reading if it completes an answer.
    fn take(&mut self, byte: u8) -> Option<Result<EngineReading, ReadError>> {
        if self.length == ANSWER_BYTES {
            // No answer starts at the oldest byte, but one may at any other.
            self.window.rotate_left(1);
            self.length -= 1;
        }
        *self.window.get_mut(self.length)? = byte;
        self.length += 1;
        if self.length < ANSWER_BYTES {
            return None;
        }
        let reading = self.decode()?;
        self.length = 0;
        Some(reading)
    }

    /// Decodes the window, if it is a valid answer.
    ///
    /// # Errors
    /// Duration or speed is at the end of its word, which no engine reaches: it is over range.
    fn decode(&self) -> Option<Result<EngineReading, ReadError>> {
        let [_, _, content @ .., c3, c2, c1, c0] = &self.window;
        let [_, injection1, injection0, _, _, speed1, speed0] = *content;
        let is_answer = self.window.starts_with(&ANSWER_START);
        // That of a file is not inverted.
        let crc = !file_crc32(u32::MAX, content);
        if !is_answer || crc != u32::from_be_bytes([*c3, *c2, *c1, *c0]) {
            return None;
        }
        let injection_us = u16::from_be_bytes([injection1, injection0]);
        let speed_rpm = u16::from_be_bytes([speed1, speed0]);
        if injection_us == u16::MAX || speed_rpm == u16::MAX {
            return Some(Err(ReadError::OverRange));
        }
        Some(Ok(EngineReading {
            injection_ms: f32::from(injection_us) * 1e-3,
            speed_rpm,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    /// The CRC-32 of ISO 3309 bit by bit.
    fn crc(bytes: &[u8]) -> [u8; 4] {
        let step = |crc: u32, _| crc >> 1 ^ if crc & 1 != 0 { 0xEDB8_8320 } else { 0 };
        let add = |crc, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), step);
        (!bytes.iter().fold(u32::MAX, add)).to_be_bytes()
    }

    fn wrapped(content: &[u8]) -> Vec<u8> {
        let length = (content.len() as u16).to_be_bytes();
        [&length, content, &crc(content)].concat()
    }

    fn answer(injection_us: u16, speed_rpm: u16) -> Vec<u8> {
        let ([i1, i0], [s1, s0]) = (injection_us.to_be_bytes(), speed_rpm.to_be_bytes());
        wrapped(&[0, i1, i0, 0xAA, 0xBB, s1, s0])
    }

    fn read(decoder: &mut MegaSquirt, bytes: &[u8]) -> Vec<EngineReading> {
        bytes
            .iter()
            .filter_map(|byte| decoder.take(*byte))
            .map(|reading| reading.unwrap())
            .collect()
    }

    fn reading(injection_us: u16, speed_rpm: u16) -> EngineReading {
        EngineReading {
            injection_ms: f32::from(injection_us) * 1e-3,
            speed_rpm,
        }
    }

    #[test]
    fn request_is_wrapped_as_any_content() {
        assert_eq!(REQUEST[..], wrapped(&[b'r', 0, 7, 0, 2, 0, 6]));
        // `zlib.crc32` of the same bytes.
        assert_eq!(crc(&[b'r', 0, 7, 0, 2, 0, 6]), 0xBE5C_B337u32.to_be_bytes());
    }

    #[test]
    fn answer_has_injection_and_speed() {
        // 3000 µs at 3000 rpm; the checksum is `zlib.crc32`'s.
        let answer = [0, 7, 0, 0x0B, 0xB8, 0, 0, 0x0B, 0xB8, 0xF1, 0x52, 0x8E, 0x1D];
        let mut decoder = MegaSquirt::new(&());
        assert_eq!(read(&mut decoder, &answer), [reading(3000, 3000)]);
    }

    #[test]
    fn refusals_and_other_lengths_are_no_readings() {
        let mut decoder = MegaSquirt::new(&());
        // Out of range, of ArduPilot's list of response codes.
        assert_eq!(read(&mut decoder, &wrapped(&[0x84])), []);
        assert_eq!(read(&mut decoder, &wrapped(&[0x84, 1, 2, 3, 4, 5, 6])), []);
        assert_eq!(read(&mut decoder, &wrapped(&[0; 6])), []);
        assert_eq!(read(&mut decoder, &wrapped(&[0; 8])), []);
        assert_eq!(read(&mut decoder, &[0; 100]), [], "a line held low");
        assert_eq!(read(&mut decoder, &REQUEST), [], "its own request");
    }

    #[test]
    fn unit_is_asked_ten_times_a_second() {
        let mut decoder = MegaSquirt::new(&());
        let asked = |decoder: &mut MegaSquirt, us| decoder.next_request(at_us(us)).is_some();
        assert!(asked(&mut decoder, 1_000));
        assert_eq!(decoder.next_due(), Some(at_us(1_000 + INTERVAL_US)));
        assert!(!asked(&mut decoder, INTERVAL_US));
        assert!(asked(&mut decoder, 1_000 + INTERVAL_US));
    }

    #[test]
    fn rest_of_an_answer_is_dropped_with_the_next_request() {
        let mut decoder = MegaSquirt::new(&());
        read(&mut decoder, &answer(1, 2)[..7]);
        decoder.next_request(at_us(INTERVAL_US));
        assert_eq!(read(&mut decoder, &answer(1, 2)[7..]), []);
        assert_eq!(read(&mut decoder, &answer(3, 4)), [reading(3, 4)]);
    }
}
