//! The open file, and the ground station that it is open for.

use heapless::Vec;

use super::parameter_file::ParameterFile;
use super::upload::Upload;
use crate::mavlink::Peer;
use crate::mavlink::messages::{FileAnswerHeader, FileError, MAX_FILE_BYTES};
use crate::mavlink::services::log_download::LogRead;
use crate::parameter::{DescriptionFile, Parameters};
use crate::recorder::LogFile;
use crate::system::LogProtocol;
use crate::time::Instant;

/// After this long without a request or an answer, another ground station gets the session, in µs.
const SILENCE_US: u64 = 10_000_000;

/// Bytes of a file or of a list, for one message.
pub(super) type Bytes = Vec<u8, MAX_FILE_BYTES>;

#[derive(Debug)]
pub(super) struct Session {
    pub station: Peer,
    pub id: u8,
    pub file: OpenFile,
    /// Whether a request for it was signed with the key.
    pub is_signed: bool,
    /// When its last request or answer was.
    pub active_at: Instant,
}

#[derive(Debug)]
pub(super) enum OpenFile {
    /// With the length that it had when it was opened.
    Log(LogFile),
    Parameters(ParameterFile),
    Description(DescriptionFile),
    Upload(Upload),
}

impl Session {
    /// Whether it is kept from others: it is not silent.
    // Inlined, it would be repeated in each use.
    #[inline(never)]
    pub fn is_in_use(&self, now: Instant) -> bool {
        now.us_since(self.active_at) < SILENCE_US
    }

    /// Whether a request belongs to it.
    pub fn has(&self, header: FileAnswerHeader) -> bool {
        self.station == header.to && self.id == header.session
    }
}

impl OpenFile {
    /// The read of a log for `bytes` bytes from `offset` on; `None` if it needs none.
    pub fn log_read(&self, offset: u32, bytes: u8) -> Option<LogRead> {
        match self {
            Self::Log(log) => log_read(log, offset, bytes),
            Self::Parameters(_) | Self::Description(_) | Self::Upload(_) => None,
        }
    }

    /// Up to `bytes` bytes from `offset` on, for which no log has to be read.
    pub fn read(&mut self, offset: u32, bytes: u8, parameters: &Parameters) -> Result<Bytes, FileError> {
        match self {
            Self::Log(_) => Err(FileError::EndOfFile),
            Self::Parameters(file) => unless_empty(file.read(offset, bytes, parameters)?),
            Self::Description(file) => unless_empty(part(file.content(), offset, bytes)),
            Self::Upload(_) => Err(FileError::Fail),
        }
    }
}

/// The read of `log` for `bytes` bytes from `offset` on; `None` at its end.
pub(super) fn log_read(log: &LogFile, offset: u32, bytes: u8) -> Option<LogRead> {
    let rest = log.bytes.saturating_sub(offset).min(u32::from(bytes));
    (rest > 0).then_some(LogRead {
        number: log.number,
        offset,
        bytes: rest as u8,
        protocol: LogProtocol::FileTransfer,
    })
}

/// Up to `bytes` bytes of `content` from `offset` on.
fn part(content: &[u8], offset: u32, bytes: u8) -> Bytes {
    let rest = content.iter().skip(offset as usize);
    // A message has room for what is read at once.
    rest.take(usize::from(bytes).min(MAX_FILE_BYTES))
        .copied()
        .collect()
}

/// Nothing is the end of a file or list.
pub(super) fn unless_empty(bytes: Bytes) -> Result<Bytes, FileError> {
    if bytes.is_empty() {
        return Err(FileError::EndOfFile);
    }
    Ok(bytes)
}
