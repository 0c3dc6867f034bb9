//! Whether a log ends while the rover is armed: then the power has ended the drive.

use super::format::{FORMATS, HEADER_BYTES, Kind};
use super::packet::SYNCHRONISATION;

/// Offset of the fields behind `TimeUS`, in bytes.
const FIELDS_AT: usize = HEADER_BYTES + 8;

/// Reads a log from its beginning.
#[derive(Debug)]
pub struct LastArming<'a> {
    /// The message after which nothing is recorded, although the rover may be disarmed.
    last_text: &'a [u8],
    is_armed: bool,
    record: Record,
}

/// The record that is being read.
#[derive(Clone, Copy, Debug)]
struct Record {
    /// Bytes of it so far.
    read: usize,
    /// Its length and kind, once its header was read.
    format: Option<(usize, Kind)>,
    /// Whether the rover is armed by this record; for a message whether it is the last text so far.
    says_armed: bool,
    is_last_text: bool,
}

impl Record {
    const NONE: Self = Self {
        read: 0,
        format: None,
        says_armed: false,
        is_last_text: true,
    };
}

impl<'a> LastArming<'a> {
    /// Nothing was read. `last_text` is the message after which nothing is recorded, although the rover may be disarmed.
    pub fn new(last_text: &'a str) -> Self {
        Self {
            last_text: last_text.as_bytes(),
            is_armed: false,
            record: Record::NONE,
        }
    }

    /// Whether what was read so far ends while armed. Without an arming it says nothing.
    pub fn is_armed(&self) -> bool {
        self.is_armed
    }

    /// Takes the next byte. A record counts once it is complete; what is torn or damaged is skipped.
    pub fn add(&mut self, byte: u8) {
        let record = &mut self.record;
        let at = record.read;
        record.read += 1;
        let Some((length, kind)) = record.format else {
            match SYNCHRONISATION.get(at) {
                Some(expected) if *expected == byte => {}
                None => {
                    let format = FORMATS.iter().find(|format| format.kind as u8 == byte);
                    record.format = format.map(|format| (format.record_bytes(), format.kind));
                    if format.is_none() {
                        *record = Record::NONE;
                    }
                }
                _ => {
                    let [first, _] = SYNCHRONISATION;
                    *record = Record::NONE;
                    record.read = usize::from(byte == first);
                }
            }
            return;
        };
        if let Some(field) = at.checked_sub(FIELDS_AT) {
            record.says_armed |= field == 0 && byte != 0;
            record.is_last_text &= self.last_text.get(field).is_none_or(|expected| *expected == byte);
        }
        if record.read == length {
            match kind {
                Kind::Arming => self.is_armed = record.says_armed,
                Kind::Message => self.is_armed &= !record.is_last_text,
                _ => {}
            }
            *record = Record::NONE;
        }
    }
}
