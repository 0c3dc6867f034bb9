//! Readers of recordings, a file a format: each makes the same entries of one, see [`entry`].
//!
//! A format is recognized by its content: names mislead.

pub mod binlog;
pub mod csv;
pub mod dataflash;
pub mod entry;
pub mod log;
pub mod px4;
pub mod tlog;
pub mod ulog;

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use self::csv::Csv;
use self::entry::Entries;
use self::tlog::Senders;

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

/// End of the name of a file in which MAVProxy keeps a log's messages without their times.
const WITHOUT_TIMES: &str = ".raw";

/// A format that can be read.
#[derive(Clone, Debug, PartialEq)]
pub enum Format {
    /// A log of ArduPilot or this board.
    DataFlash,
    /// A log of ArduPilot as text.
    Text,
    /// A ground station's, with the findings of a first pass.
    Telemetry(Senders),
    /// PX4's.
    ULog,
    /// Text in columns.
    Csv,
}

impl Format {
    /// That of a file. Of a ground station's log `system` is the id of the vehicle, if the user has chosen one.
    ///
    /// # Errors
    /// Why it can't be read, in words.
    pub fn of(path: &Path, system: Option<u8>) -> Result<Self, String> {
        if path.is_dir() {
            return Err("a folder: --table and --history read folders".into());
        }
        readable_bytes(path)?;
        let head = head(path).map_err(|error| error.to_string())?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let log = name
            .strip_suffix(WITHOUT_TIMES)
            .filter(|log| log.ends_with(".tlog"));
        if let Some(log) = log.filter(|_| !tlog::is_tlog(&head)) {
            return Err(format!("without times: {log} has them"));
        }
        match (Self::of_head(&head)?, system) {
            (Self::Telemetry(_), _) => Self::of_station(path, system),
            (_, Some(_)) => Err("--system is for logs of ground stations (.tlog)".into()),
            (format, None) => Ok(format),
        }
    }

    /// That of a log; CSV is none.
    ///
    /// # Errors
    /// Why it can't be read as a log, in words.
    pub fn of_log(path: &Path) -> Result<Self, String> {
        match Self::of(path, None)? {
            Self::Csv => Err(format!("text, but not {LOGS}")),
            log => Ok(log),
        }
    }

    fn of_station(path: &Path, system: Option<u8>) -> Result<Self, String> {
        let senders = File::open(path).and_then(|file| Senders::of(file, system));
        let senders = senders.map_err(|error| error.to_string())?;
        if let Some(system) = system.filter(|_| !senders.has_vehicle()) {
            let others: Vec<String> = senders.others().map(|(id, _)| id.to_string()).collect();
            return Err(format!("no vehicle {system}, but {}", others.join(", ")));
        }
        Ok(Self::Telemetry(senders))
    }

    fn of_head(head: &[u8]) -> Result<Self, String> {
        if head.is_empty() {
            return Err("empty".into());
        }
        if COMPRESSED.iter().any(|beginning| head.starts_with(beginning)) {
            return Err("compressed: unpack it first".into());
        }
        // Another record follows.
        let is_format = |bytes: &[u8]| {
            let following = &bytes[FORMAT_RECORD_BYTES..];
            bytes.starts_with(&FORMAT_RECORD) && following == &FORMAT_RECORD[..2]
        };
        let mut records = head.windows(FORMAT_RECORD_BYTES + 2);
        let mut lines = head.split(|byte| *byte == b'\n');
        let text = head.strip_prefix(&[0]).unwrap_or(head);
        match head {
            _ if ulog::is_ulog(text) => Ok(Self::ULog),
            _ if tlog::is_tlog(head) => Ok(Self::Telemetry(Senders::default())),
            _ if records.any(is_format) => Ok(Self::DataFlash),
            _ if tlog::has_messages(head) => Ok(Self::Telemetry(Senders::default())),
            _ if !is_text(text) => Err(format!("neither {LOGS} nor CSV")),
            _ if lines.any(|line| line.starts_with(FORMAT_LINE)) => Ok(Self::Text),
            _ => Ok(Self::Csv),
        }
    }

    /// The entries of a recording of this format.
    ///
    /// # Errors
    /// It can't be opened.
    pub fn open(&self, path: &Path) -> io::Result<Box<dyn Entries>> {
        let file = File::open(path)?;
        Ok(match self {
            Self::DataFlash => Box::new(dataflash::binary(file)),
            Self::Text => Box::new(dataflash::text(file)),
            Self::Telemetry(senders) => Box::new(tlog::read(file, senders.clone())),
            Self::ULog => Box::new(ulog::read(file)),
            Self::Csv => Box::new(Csv::of(file)),
        })
    }
}

/// The beginning of a file behind any zeros but the last one: the time of a ground station's message begins with one.
fn head(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = BufReader::new(File::open(path)?);
    let mut zeros = 0;
    loop {
        let block = file.fill_buf()?;
        let in_block = block.iter().take_while(|byte| **byte == 0).count();
        let is_end = in_block < block.len() || block.is_empty();
        zeros += in_block as u64;
        file.consume(in_block);
        if is_end {
            break;
        }
    }
    file.seek(SeekFrom::Start(zeros.saturating_sub(1)))?;
    let mut head = vec![];
    file.take(HEAD_BYTES).read_to_end(&mut head)?;
    Ok(head)
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
    use super::binlog::tests::opening;
    use super::*;

    #[test]
    fn a_format_is_recognized_by_the_content() {
        let log = Ok(Format::DataFlash);
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
