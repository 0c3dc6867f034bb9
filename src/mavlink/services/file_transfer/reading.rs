//! Answers being sent: parts of a file or list, a burst, a checksum.

use super::directory::{Directory, Listed, list};
use super::session::{Bytes, Session, log_read, unless_empty};
use crate::mavlink::messages::{
    Burst, FileAnswer, FileAnswerHeader, FileData, FileError, FileOutcome, MAX_FILE_BYTES,
};
use crate::mavlink::services::log_download::{LogRead, Step};
use crate::mavlink::{Message, Outgoing};
use crate::memory::checksum::file_crc32;
use crate::parameter::Parameters;
use crate::recorder::LogFile;
use crate::system::SystemState;
use crate::time::Instant;

/// Messages in a burst. A ground station that is gone receives no more than these.
const BURST_MESSAGES: u16 = 200;

/// A burst ends with the first message after this time, in µs: pymavlink gives up 3.7 s after it has requested one, however
/// many messages have come.
const BURST_US: u64 = 2_000_000;

/// The answer being sent, one at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Job {
    Part(PartRequest),
    Burst(BurstRead),
    Checksum(Checksum),
}

impl Job {
    /// The session that it reads, if that is still open.
    fn session_of<'a>(&self, session: Option<&'a mut Session>) -> Option<&'a mut Session> {
        let header = match self {
            Self::Part(part) => part.header,
            Self::Burst(burst) => burst.header,
            Self::Checksum(checksum) => checksum.header,
        };
        session.filter(|session| session.has(header))
    }

    /// The read of a log that its next message needs, if one is needed.
    pub fn log_read(&self, session: Option<&mut Session>) -> Option<LogRead> {
        match self {
            Self::Part(PartRequest {
                offset,
                of: PartOf::File { bytes },
                ..
            })
            | Self::Burst(BurstRead { offset, bytes, .. }) => {
                self.session_of(session)?.file.log_read(*offset, *bytes)
            }
            Self::Part(_) => None,
            Self::Checksum(checksum) => log_read(&checksum.file, checksum.offset, MAX_FILE_BYTES as u8),
        }
    }

    /// The content of its next message, for which no log has to be read.
    pub fn content(
        &self,
        session: Option<&mut Session>,
        state: &SystemState<'_>,
        parameters: &Parameters,
    ) -> Result<Bytes, FileError> {
        match self {
            Self::Part(PartRequest {
                offset,
                of: PartOf::Directory(directory, listed),
                ..
            }) => unless_empty(list(*directory, *listed, *offset, state.logs)),
            Self::Part(PartRequest {
                offset,
                of: PartOf::File { bytes },
                ..
            })
            | Self::Burst(BurstRead { offset, bytes, .. }) => {
                let session = self.session_of(session).ok_or(FileError::InvalidSession)?;
                session.file.read(*offset, *bytes, parameters)
            }
            Self::Checksum(_) => Err(FileError::EndOfFile),
        }
    }
}

/// A request for a part of a file or list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PartRequest {
    pub header: FileAnswerHeader,
    pub offset: u32,
    pub of: PartOf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PartOf {
    Directory(Directory, Listed),
    /// This many bytes of the open file.
    File {
        bytes: u8,
    },
}

impl PartRequest {
    /// The one message that answers it.
    pub fn message(self, content: Result<Bytes, FileError>) -> Step {
        message(self.header, Burst::Continues, self.offset, content)
    }
}

/// The rest of a burst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BurstRead {
    /// The request's.
    pub first: FileAnswerHeader,
    /// Of the next message.
    header: FileAnswerHeader,
    offset: u32,
    /// Of each message.
    bytes: u8,
    messages_left: u16,
    began_at: Instant,
}

impl BurstRead {
    /// A burst with size 0 is one of the longest messages, as in ArduPilot.
    pub fn new(header: FileAnswerHeader, offset: u32, bytes: u8, now: Instant) -> Self {
        Self {
            first: header,
            header,
            offset,
            bytes: if bytes == 0 { MAX_FILE_BYTES as u8 } else { bytes },
            messages_left: BURST_MESSAGES,
            began_at: now,
        }
    }

    /// Ends the burst with the next message if it has taken too long.
    pub fn limit_time(&mut self, now: Instant) {
        if now.us_since(self.began_at) >= BURST_US {
            self.messages_left = 1;
        }
    }

    /// The next message and the rest of the burst.
    pub fn advance(self, content: Result<Bytes, FileError>) -> (Step, Option<Self>) {
        let messages_left = match content {
            Ok(_) => self.messages_left.saturating_sub(1),
            Err(_) => 0,
        };
        let read_bytes = content.as_ref().map_or(0, |data| data.len() as u32);
        let rest = (messages_left > 0).then_some(Self {
            header: FileAnswerHeader {
                sequence: self.header.sequence.wrapping_add(1),
                ..self.header
            },
            offset: self.offset.saturating_add(read_bytes),
            messages_left,
            ..self
        });
        let burst = if rest.is_some() {
            Burst::Continues
        } else {
            Burst::Complete
        };
        (message(self.header, burst, self.offset, content), rest)
    }
}

/// A checksum that is being computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Checksum {
    pub header: FileAnswerHeader,
    file: LogFile,
    offset: u32,
    crc: u32,
}

impl Checksum {
    pub fn new(header: FileAnswerHeader, file: LogFile) -> Self {
        Self {
            header,
            file,
            offset: 0,
            crc: 0,
        }
    }

    /// Adds what was read. At the end of the file the checksum is the answer.
    pub fn advance(self, content: Result<Bytes, FileError>) -> (Step, Option<Self>) {
        let outcome = match content {
            Ok(bytes) => {
                let rest = Self {
                    offset: self.offset.saturating_add(bytes.len() as u32),
                    crc: file_crc32(self.crc, &bytes),
                    ..self
                };
                return (Step::Idle, Some(rest));
            }
            Err(FileError::EndOfFile) => FileOutcome::Number(self.crc),
            Err(error) => FileOutcome::Failed(error),
        };
        (answer(self.header, Burst::Continues, 0, outcome), None)
    }
}

fn message(header: FileAnswerHeader, burst: Burst, offset: u32, content: Result<Bytes, FileError>) -> Step {
    match content {
        Ok(data) => Step::Send(Outgoing::FileData(FileData {
            header,
            burst,
            offset,
            data,
        })),
        Err(error) => answer(header, burst, offset, FileOutcome::Failed(error)),
    }
}

fn answer(header: FileAnswerHeader, burst: Burst, offset: u32, outcome: FileOutcome) -> Step {
    Step::Send(Outgoing::Message(Message::FileAnswer(FileAnswer {
        header,
        burst,
        offset,
        outcome,
    })))
}
