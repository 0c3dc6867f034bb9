//! The format of a recording, by its content: names mislead.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use crate::binlog::{BinaryRecords, TextRecords};
use crate::dataflash::DataFlash;
use crate::entry::Entries;
use crate::tlog::{Tlog, is_tlog};
use crate::ulog::{ULog, is_ulog};

/// The longest log that is read, in bytes. The board's have 1 MB at most, and ArduPilot's seldom more than 100 MB; reading this
/// much takes a processor some seconds.
const LONGEST_BYTES: u64 = 256 << 20;

/// Bytes at the beginning of a file that show its format. A damaged log may begin with others.
const HEAD_BYTES: u64 = 1 << 16;

/// Beginning of a record of ArduPilot's that describes a format, and the length of one.
const FORMAT_RECORD: [u8; 3] = [0xa3, 0x95, 128];
const FORMAT_RECORD_BYTES: usize = 89;

/// Beginning of a line that describes a format.
const FORMAT_LINE: &[u8] = b"FMT, ";

/// Beginnings of compressed files: ZIP, gzip, xz, 7-Zip.
const COMPRESSED: [&[u8]; 4] = [b"PK\x03\x04", b"\x1f\x8b", b"\xfd7zXZ", b"7z\xbc\xaf"];

const BYTE_ORDER_MARKS_OF_UTF16: [[u8; 2]; 2] = [[0xff, 0xfe], [0xfe, 0xff]];

/// The logs that can be read.
pub const LOGS: &str = "a log of ArduPilot (.BIN, .log), PX4 (.ulg) or a ground station (.tlog)";

/// A format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A log of ArduPilot or this board.
    Log(LogFormat),
    /// Text in columns.
    Csv,
}

/// A format of logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// ArduPilot's and this board's.
    DataFlash,
    /// The same as text.
    Text,
    /// A ground station's.
    Telemetry,
    /// PX4's.
    ULog,
}

impl Format {
    /// That of a file.
    ///
    /// # Errors
    /// Why it can't be read, in words.
    pub fn of(path: &Path) -> Result<Self, String> {
        if path.is_dir() {
            return Err("a folder: --table and --history read folders".into());
        }
        readable_bytes(path)?;
        let mut head = vec![];
        let file = File::open(path).map_err(|error| error.to_string())?;
        let read = file.take(HEAD_BYTES).read_to_end(&mut head);
        read.map_err(|error| error.to_string())?;
        Self::of_head(&head)
    }

    fn of_head(head: &[u8]) -> Result<Self, String> {
        if head.is_empty() {
            return Err("empty".into());
        }
        if COMPRESSED.iter().any(|beginning| head.starts_with(beginning)) {
            return Err("compressed: unpack it first".into());
        }
        if let Some(format) = LogFormat::of_head(head) {
            return Ok(Self::Log(format));
        }
        if is_text(head) {
            return Ok(Self::Csv);
        }
        Err(format!("neither {LOGS} nor CSV"))
    }
}

impl LogFormat {
    /// That of a file.
    ///
    /// # Errors
    /// Why it can't be read as a log, in words.
    pub fn of(path: &Path) -> Result<Self, String> {
        match Format::of(path)? {
            Format::Log(format) => Ok(format),
            Format::Csv => Err(format!("text, but not {LOGS}")),
        }
    }

    fn of_head(head: &[u8]) -> Option<Self> {
        if is_ulog(head) {
            return Some(Self::ULog);
        }
        if is_tlog(head) {
            return Some(Self::Telemetry);
        }
        // Another record follows.
        let is_format = |bytes: &[u8]| {
            let following = &bytes[FORMAT_RECORD_BYTES..];
            bytes.starts_with(&FORMAT_RECORD) && following == &FORMAT_RECORD[..2]
        };
        let mut records = head.windows(FORMAT_RECORD_BYTES + 2);
        if records.any(is_format) {
            return Some(Self::DataFlash);
        }
        let has_format = || {
            head.split(|byte| *byte == b'\n')
                .any(|line| line.starts_with(FORMAT_LINE))
        };
        (is_text(head) && has_format()).then_some(Self::Text)
    }

    /// The entries of a log of this format.
    ///
    /// # Errors
    /// It can't be opened.
    pub fn open(self, path: &Path) -> io::Result<Box<dyn Entries>> {
        let file = File::open(path)?;
        Ok(match self {
            Self::DataFlash => Box::new(DataFlash::of(BinaryRecords::of(file))),
            Self::ULog => Box::new(ULog::of(file)),
            Self::Telemetry => Box::new(Tlog::of(file)),
            Self::Text => Box::new(DataFlash::of(TextRecords::of(file))),
        })
    }
}

/// Length of a log that can be read, in bytes.
///
/// # Errors
/// Why it can't, in words.
pub fn readable_bytes(path: &Path) -> Result<u64, String> {
    let file = fs::metadata(path).map_err(|error| error.to_string())?;
    match file.len() {
        _ if !file.is_file() => Err("no file".into()),
        bytes if bytes > LONGEST_BYTES => Err(format!("larger than {} MiB", LONGEST_BYTES >> 20)),
        bytes => Ok(bytes),
    }
}

/// Whether there are only characters of text, in any encoding of bytes or in UTF-16.
fn is_text(head: &[u8]) -> bool {
    let is_utf_16 = BYTE_ORDER_MARKS_OF_UTF16
        .iter()
        .any(|mark| head.starts_with(mark));
    is_utf_16 || !head.iter().any(|byte| matches!(byte, 0..=8 | 14..=31 | 127))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::binlog::tests::opening;

    #[test]
    fn a_format_is_recognized_by_the_content() {
        let log = Ok(Format::Log(LogFormat::DataFlash));
        assert_eq!(Format::of_head(&opening()), log);
        assert_eq!(Format::of_head(&[&[0xff; 500], &*opening()].concat()), log);
        for text in [b"t_s,voltage_v\n".as_slice(), b"\xff\xfet\0_\0s\0", b"caf\xe9\n"] {
            assert_eq!(Format::of_head(text), Ok(Format::Csv));
        }
    }

    #[test]
    fn other_files_get_a_clear_line() {
        let reason = |head: &[u8]| Format::of_head(head).expect_err("no recording");
        assert_eq!(reason(b""), "empty");
        assert_eq!(reason(b"PK\x03\x04\x14\0"), "compressed: unpack it first");
        assert_eq!(reason(b"\x7fELF\x02\x01"), format!("neither {LOGS} nor CSV"));
    }
}
