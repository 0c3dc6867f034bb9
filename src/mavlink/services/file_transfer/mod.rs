//! MAVLink FTP: the log files to read, and the packed parameters (`@PARAM/param.pck`) to read and to write.
//!
//! One session is open on a link. It ends by request, when the rover is armed, when its ground station opens another file,
//! and when another station opens one after it has been silent. A new `SYSID_THISMAV` takes effect when the session of its
//! file ends by request, since all requests of a session are addressed to the same system id. A request that comes again is served again, which has the
//! same result; only what is being worked on is not begun a second time.

mod listing;
mod packed;
mod parameter_file;
mod path;
mod upload;

use core::str;

use heapless::{Deque, Vec};

use super::log_download::LogRead;
use crate::mavlink::Peer;
use crate::mavlink::messages::{
    Burst, FileAnswer, FileAnswerHeader, FileData, FileError, FileOutcome, MAX_FILE_BYTES,
};
use crate::mavlink::requests::FileTransfer;
use crate::memory::checksum::file_crc32;
use crate::parameter::{ParameterId, Parameters, VehicleParameter};
use crate::recorder::LogFile;
use crate::system::SystemState;
use crate::time::Instant;
use listing::list;
use parameter_file::ParameterFile;
use path::{Directory, Path};
pub(in crate::mavlink) use upload::NotSet;
use upload::{Upload, Written};

/// After this long without a request or an answer, another ground station gets the session, in µs.
const SILENCE_US: u64 = 10_000_000;

/// Messages in a burst. A ground station that is gone receives no more than these.
const BURST_MESSAGES: u16 = 200;

/// A burst ends with the first message after this time, in µs: pymavlink gives up 3.7 s after it has requested one, however
/// many messages have come.
const BURST_US: u64 = 2_000_000;

/// Requests for a part of a file or list that can wait. Ground stations send a few ahead.
const MAX_WAITING: usize = 8;

/// The longest path: that of parameters with all arguments.
const MAX_PATH_BYTES: usize = 64;

/// What a request asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operation {
    None,
    TerminateSession,
    ResetSessions,
    ListDirectory,
    OpenForReading,
    Read,
    OpenForWriting,
    Write,
    Checksum,
    BurstRead,
    /// To remove, create, rename or cut something.
    Change,
}

impl Operation {
    fn from_opcode(opcode: u8) -> Option<Self> {
        Some(match opcode {
            0 => Self::None,
            1 => Self::TerminateSession,
            2 => Self::ResetSessions,
            3 => Self::ListDirectory,
            4 => Self::OpenForReading,
            5 => Self::Read,
            6 | 11 => Self::OpenForWriting,
            7 => Self::Write,
            8..=10 | 12 | 13 => Self::Change,
            14 => Self::Checksum,
            15 => Self::BurstRead,
            _ => return None,
        })
    }
}

/// Whether a request with this opcode can change anything but the session.
pub(in crate::mavlink) fn writes(opcode: u8) -> bool {
    let operation = Operation::from_opcode(opcode);
    matches!(operation, Some(Operation::OpenForWriting | Operation::Write))
}

/// What a request led to, beside its answer.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::mavlink) enum FileEvent {
    /// Nothing.
    Served,
    /// A ground station reads all parameters.
    ParametersOpened,
    /// Parameters were set.
    ParametersSet,
    /// A file of parameters is complete, but some of them do not exist or were out of range.
    ParametersNotSet(NotSet),
    /// A log was refused to a ground station since the rover is armed.
    RefusedArmed,
}

/// What comes next.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap, and one of it exists at a time"
)]
pub(in crate::mavlink) enum FileStep {
    /// Nothing.
    Idle,
    /// Have a log read.
    Read(LogRead),
    /// Send an answer.
    Answer(FileAnswer),
    /// Send bytes of a file or of a list.
    Data(FileData),
}

/// A request that was taken: its answer, unless that follows, and what else it led to.
type Handled = (Option<FileOutcome>, FileEvent);

/// The session of a link, and the requests that are being served.
#[derive(Debug, Default)]
pub(in crate::mavlink) struct FileTransfers {
    session: Option<Session>,
    waiting: Deque<PartRequest, MAX_WAITING>,
    burst: Option<BurstRead>,
    checksum: Option<Checksum>,
    last_end: Option<(FileAnswerHeader, FileOutcome)>,
}

#[derive(Debug)]
struct Session {
    station: Peer,
    id: u8,
    file: OpenFile,
    active_at: Instant,
}

#[derive(Debug)]
enum OpenFile {
    /// With the length that it had when it was opened.
    Log(LogFile),
    Parameters(ParameterFile),
    Upload(Upload),
}

/// A request for a part of a file or list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PartRequest {
    header: FileAnswerHeader,
    offset: u32,
    of: PartOf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PartOf {
    Directory(Directory),
    /// This many bytes of the open file.
    File {
        bytes: u8,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct BurstRead {
    /// The request's.
    first: FileAnswerHeader,
    /// Of the next message.
    header: FileAnswerHeader,
    offset: u32,
    /// Of each message.
    bytes: u8,
    messages_left: u16,
    began_at: Instant,
}

/// A checksum that is being computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Checksum {
    header: FileAnswerHeader,
    file: LogFile,
    offset: u32,
    crc: u32,
}

/// What is read of the open file.
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap, and one of it exists at a time"
)]
enum Content {
    Log(LogRead),
    Bytes(Vec<u8, MAX_FILE_BYTES>),
    Error(FileError),
}

impl FileTransfers {
    /// Takes a request, and returns its answer unless that follows by [`Self::step`].
    pub fn handle(
        &mut self,
        request: &FileTransfer<'_>,
        from: Peer,
        state: &SystemState<'_>,
        parameters: &mut Parameters,
        on_set: impl FnMut(ParameterId),
    ) -> (Option<FileAnswer>, FileEvent) {
        /// From here on opcodes are those of answers.
        const FIRST_ANSWER: u8 = 128;
        if request.opcode >= FIRST_ANSWER {
            return (None, FileEvent::Served);
        }
        let header = FileAnswerHeader {
            to: from,
            sender_system: parameters.get_whole(VehicleParameter::SysidThismav) as u8,
            sequence: request.sequence.wrapping_add(1),
            session: request.session,
            request_opcode: request.opcode,
        };
        if state.is_armed() {
            self.stop();
        }
        if let Some(session) = self.session_of(header) {
            session.active_at = state.now;
        }
        let (outcome, event) = if usize::from(request.size) > MAX_FILE_BYTES {
            failed(FileError::InvalidDataSize)
        } else {
            match Operation::from_opcode(request.opcode) {
                None => failed(FileError::UnknownCommand),
                Some(Operation::None) => done(),
                Some(Operation::TerminateSession) => self.terminate(header, parameters),
                Some(Operation::ResetSessions) => self.reset(from, parameters),
                Some(Operation::ListDirectory) => self.list(header, request),
                Some(Operation::OpenForReading) => self.open(header, request, state, parameters),
                Some(Operation::Read) => self.read(header, request),
                Some(Operation::OpenForWriting) => self.open_upload(header, request, state),
                Some(Operation::Write) => self.write(header, request, parameters, on_set),
                Some(Operation::Checksum) => self.start_checksum(header, request, state),
                Some(Operation::BurstRead) => self.start_burst(header, request, state.now),
                Some(Operation::Change) => failed(FileError::FileProtected),
            }
        };
        let answer = outcome.map(|outcome| FileAnswer {
            header,
            burst: Burst::Continues,
            offset: request.offset,
            outcome,
        });
        (answer, event)
    }

    /// The session that a request belongs to, if it is open.
    fn session_of(&mut self, header: FileAnswerHeader) -> Option<&mut Session> {
        let session = self.session.as_mut()?;
        (session.station == header.to && session.id == header.session).then_some(session)
    }

    /// Closes the session. Whether all of a file of parameters came is the answer, also to the same request again. There is
    /// nothing wrong with a session that is closed.
    fn terminate(&mut self, header: FileAnswerHeader, parameters: &mut Parameters) -> Handled {
        if let Some((last, outcome)) = self.last_end
            && last == header
        {
            return (Some(outcome), FileEvent::Served);
        }
        let mut handled = done();
        if self.session_of(header).is_some() {
            handled = self.close(parameters);
        }
        if let (Some(outcome), _) = handled {
            self.last_end = Some((header, outcome));
        }
        handled
    }

    /// Closes the session if it is this station's.
    fn reset(&mut self, from: Peer, parameters: &mut Parameters) -> Handled {
        let is_own = |session: &Session| session.station == from;
        if self.session.as_ref().is_some_and(is_own) {
            let (_, event) = self.close(parameters);
            return (Some(FileOutcome::Done), event);
        }
        done()
    }

    /// Closes the session by request. A file of parameters that came whole has its full effect now.
    fn close(&mut self, parameters: &mut Parameters) -> Handled {
        let handled = match &self.session {
            Some(Session {
                file: OpenFile::Upload(upload),
                ..
            }) => end_of(upload, parameters),
            _ => done(),
        };
        self.stop();
        handled
    }

    /// Closes the session: what is being read of it ends.
    pub fn stop(&mut self) {
        self.session = None;
        self.burst = None;
        self.checksum = None;
    }

    fn list(&mut self, header: FileAnswerHeader, request: &FileTransfer<'_>) -> Handled {
        match path_of(request) {
            Ok(Path::Directory(directory)) => self.wait(header, request.offset, PartOf::Directory(directory)),
            Ok(_) => failed(FileError::FileNotFound),
            Err(error) => failed(error),
        }
    }

    /// Whether the station may open a file: there is no session, it is its own, or its station has been silent.
    fn check_free(&self, from: Peer, now: Instant) -> Result<(), FileError> {
        let is_in_use =
            |session: &Session| session.station != from && now.us_since(session.active_at) < SILENCE_US;
        if self.session.as_ref().is_some_and(is_in_use) {
            return Err(FileError::NoSessionsAvailable);
        }
        Ok(())
    }

    fn begin(&mut self, header: FileAnswerHeader, file: OpenFile, now: Instant) {
        self.stop();
        self.last_end = None;
        self.session = Some(Session {
            station: header.to,
            id: header.session,
            file,
            active_at: now,
        });
    }

    fn open(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        state: &SystemState<'_>,
        parameters: &Parameters,
    ) -> Handled {
        let opened = path_of(request).and_then(|path| {
            self.check_free(header.to, state.now)?;
            Ok(path)
        });
        match opened {
            Ok(Path::Log(_)) if state.is_armed() => refused_armed(),
            Ok(Path::Log(number)) => {
                let Some(log) = log_of(number, state) else {
                    return failed(FileError::FileNotFound);
                };
                self.begin(header, OpenFile::Log(log), state.now);
                number_is(log.bytes)
            }
            Ok(Path::Parameters(_)) if state.is_armed() => failed(FileError::Fail),
            Ok(Path::Parameters(selection)) => {
                let Some(file) = ParameterFile::open(selection, parameters) else {
                    return failed(FileError::Fail);
                };
                self.begin(header, OpenFile::Parameters(file), state.now);
                let size = FileOutcome::Number(file.bytes(parameters));
                (Some(size), FileEvent::ParametersOpened)
            }
            Ok(Path::Directory(_)) => failed(FileError::FileNotFound),
            Err(error) => failed(error),
        }
    }

    fn open_upload(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        state: &SystemState<'_>,
    ) -> Handled {
        let opened = path_of(request).and_then(|path| {
            self.check_free(header.to, state.now)?;
            Ok(path)
        });
        match opened {
            Ok(Path::Parameters(_)) if state.is_armed() => failed(FileError::Fail),
            Ok(Path::Parameters(_)) => {
                self.begin(header, OpenFile::Upload(Upload::default()), state.now);
                done()
            }
            Ok(_) => failed(FileError::FileProtected),
            Err(FileError::FileNotFound) => failed(FileError::FileProtected),
            Err(error) => failed(error),
        }
    }

    /// A block that comes too early is not answered, as if it were lost: ground stations give up at a refusal, and send again
    /// what is not answered.
    fn write(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        parameters: &mut Parameters,
        mut on_set: impl FnMut(ParameterId),
    ) -> Handled {
        let Some(session) = self.session_of(header) else {
            return failed(FileError::InvalidSession);
        };
        let OpenFile::Upload(upload) = &mut session.file else {
            return failed(FileError::FileProtected);
        };
        let mut event = FileEvent::Served;
        let written = upload.write(request.offset, request.data(), parameters, |id| {
            event = FileEvent::ParametersSet;
            on_set(id);
        });
        let outcome = match written {
            Ok(Written::Taken) => Some(FileOutcome::Done),
            Ok(Written::TooEarly) => None,
            Err(_) => Some(FileOutcome::Failed(FileError::Fail)),
        };
        (outcome, event)
    }

    /// Whether bytes of the open file can be requested.
    fn check_readable(&mut self, header: FileAnswerHeader) -> Result<(), FileError> {
        match self.session_of(header) {
            None => Err(FileError::InvalidSession),
            Some(Session {
                file: OpenFile::Upload(_),
                ..
            }) => Err(FileError::Fail),
            Some(_) => Ok(()),
        }
    }

    fn read(&mut self, header: FileAnswerHeader, request: &FileTransfer<'_>) -> Handled {
        if request.size == 0 {
            return failed(FileError::InvalidDataSize);
        }
        match self.check_readable(header) {
            Ok(()) => self.wait(header, request.offset, PartOf::File { bytes: request.size }),
            Err(error) => failed(error),
        }
    }

    /// Has a request wait for its turn. One for which there is no room is not answered, and comes again.
    fn wait(&mut self, header: FileAnswerHeader, offset: u32, of: PartOf) -> Handled {
        let part = PartRequest { header, offset, of };
        if !self.waiting.iter().any(|waiting| *waiting == part) {
            let _ = self.waiting.push_back(part);
        }
        (None, FileEvent::Served)
    }

    /// A burst with size 0 is one of the longest messages, as in ArduPilot.
    fn start_burst(&mut self, header: FileAnswerHeader, request: &FileTransfer<'_>, now: Instant) -> Handled {
        if let Err(error) = self.check_readable(header) {
            return failed(error);
        }
        if self.burst.is_none_or(|burst| burst.first != header) {
            self.burst = Some(BurstRead {
                first: header,
                header,
                offset: request.offset,
                bytes: if request.size == 0 {
                    MAX_FILE_BYTES as u8
                } else {
                    request.size
                },
                messages_left: BURST_MESSAGES,
                began_at: now,
            });
        }
        (None, FileEvent::Served)
    }

    fn start_checksum(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        state: &SystemState<'_>,
    ) -> Handled {
        let path = match path_of(request) {
            Ok(path) => path,
            Err(error) => return failed(error),
        };
        let Path::Log(number) = path else {
            // The values of parameters change, and nothing asks for a checksum of them.
            return failed(FileError::Fail);
        };
        if state.is_armed() {
            return refused_armed();
        }
        let Some(file) = log_of(number, state) else {
            return failed(FileError::FileNotFound);
        };
        if self.checksum.is_none_or(|checksum| checksum.header != header) {
            self.checksum = Some(Checksum {
                header,
                file,
                offset: 0,
                crc: 0,
            });
        }
        (None, FileEvent::Served)
    }

    /// Whether something is being sent.
    pub fn is_running(&self) -> bool {
        !self.waiting.is_empty() || self.burst.is_some()
    }

    /// What comes next. An answer counts as sent; of a read, [`Self::supply`] makes it.
    pub fn step(&mut self, state: &SystemState<'_>, parameters: &Parameters) -> FileStep {
        if let Some(part) = self.waiting.front().copied() {
            return self.step_part(part, state, parameters);
        }
        if let Some(burst) = self.burst {
            return self.step_burst(burst, state.now, parameters);
        }
        match self.checksum {
            Some(checksum) => match checksum.next_read() {
                Some(read) => FileStep::Read(read),
                None => FileStep::Answer(self.end_checksum(checksum)),
            },
            None => FileStep::Idle,
        }
    }

    fn step_part(&mut self, part: PartRequest, state: &SystemState<'_>, parameters: &Parameters) -> FileStep {
        let content = match part.of {
            PartOf::Directory(directory) => bytes_or_end(list(directory, part.offset, state.logs)),
            PartOf::File { bytes } => self.content(part.header, part.offset, bytes, parameters),
        };
        match content {
            Content::Log(read) => FileStep::Read(read),
            Content::Bytes(data) => {
                self.waiting.pop_front();
                FileStep::Data(part.data(data))
            }
            Content::Error(error) => {
                self.waiting.pop_front();
                FileStep::Answer(part.failed(error))
            }
        }
    }

    fn step_burst(&mut self, mut burst: BurstRead, now: Instant, parameters: &Parameters) -> FileStep {
        if now.us_since(burst.began_at) >= BURST_US {
            burst.messages_left = 1;
            self.burst = Some(burst);
        }
        if let Some(session) = self.session_of(burst.header) {
            session.active_at = now;
        }
        match self.content(burst.header, burst.offset, burst.bytes, parameters) {
            Content::Log(read) => FileStep::Read(read),
            Content::Bytes(data) => FileStep::Data(self.burst_data(burst, data)),
            Content::Error(error) => FileStep::Answer(self.end_burst(burst, error)),
        }
    }

    /// What is at `offset` of the open file.
    fn content(
        &mut self,
        header: FileAnswerHeader,
        offset: u32,
        bytes: u8,
        parameters: &Parameters,
    ) -> Content {
        match self.session_of(header).map(|session| &mut session.file) {
            None => Content::Error(FileError::InvalidSession),
            Some(OpenFile::Log(log)) => match read_of(log, offset, bytes) {
                Some(read) => Content::Log(read),
                None => Content::Error(FileError::EndOfFile),
            },
            Some(OpenFile::Parameters(file)) => bytes_or_end(file.read(offset, bytes, parameters)),
            Some(OpenFile::Upload(_)) => Content::Error(FileError::Fail),
        }
    }

    /// The next message of a burst.
    fn burst_data(&mut self, burst: BurstRead, data: Vec<u8, MAX_FILE_BYTES>) -> FileData {
        let messages_left = burst.messages_left.saturating_sub(1);
        self.burst = (messages_left > 0).then_some(BurstRead {
            header: FileAnswerHeader {
                sequence: burst.header.sequence.wrapping_add(1),
                ..burst.header
            },
            offset: burst.offset.saturating_add(data.len() as u32),
            messages_left,
            ..burst
        });
        FileData {
            header: burst.header,
            burst: if messages_left > 0 {
                Burst::Continues
            } else {
                Burst::Complete
            },
            offset: burst.offset,
            data,
        }
    }

    /// The last answer of a burst that can't go on.
    fn end_burst(&mut self, burst: BurstRead, error: FileError) -> FileAnswer {
        self.burst = None;
        FileAnswer {
            header: burst.header,
            burst: Burst::Complete,
            offset: burst.offset,
            outcome: FileOutcome::Failed(error),
        }
    }

    fn end_checksum(&mut self, checksum: Checksum) -> FileAnswer {
        self.checksum = None;
        checksum.answer(FileOutcome::Number(checksum.crc))
    }

    /// Takes what was read of a log, and returns what follows. Bytes that are not wanted any more have no effect.
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) -> FileStep {
        let bytes = bytes.get(..usize::from(read.bytes)).unwrap_or(bytes);
        if let Some(part) = self.waiting.front().copied() {
            return self.supply_part(part, read, bytes);
        }
        if let Some(burst) = self.burst {
            return self.supply_burst(burst, read, bytes);
        }
        match self.checksum {
            Some(checksum) if checksum.next_read() == Some(read) => self.supply_checksum(checksum, bytes),
            _ => FileStep::Idle,
        }
    }

    fn supply_part(&mut self, part: PartRequest, read: LogRead, bytes: &[u8]) -> FileStep {
        let PartOf::File { bytes: size } = part.of else {
            return FileStep::Idle;
        };
        if self.log_read(part.header, part.offset, size) != Some(read) {
            return FileStep::Idle;
        }
        self.waiting.pop_front();
        match copied(bytes) {
            Some(data) => FileStep::Data(part.data(data)),
            None => FileStep::Answer(part.failed(FileError::Fail)),
        }
    }

    fn supply_burst(&mut self, burst: BurstRead, read: LogRead, bytes: &[u8]) -> FileStep {
        if self.log_read(burst.header, burst.offset, burst.bytes) != Some(read) {
            return FileStep::Idle;
        }
        match copied(bytes) {
            Some(data) => FileStep::Data(self.burst_data(burst, data)),
            None => FileStep::Answer(self.end_burst(burst, FileError::Fail)),
        }
    }

    fn supply_checksum(&mut self, checksum: Checksum, bytes: &[u8]) -> FileStep {
        if bytes.is_empty() {
            self.checksum = None;
            return FileStep::Answer(checksum.answer(FileOutcome::Failed(FileError::Fail)));
        }
        self.checksum = Some(Checksum {
            offset: checksum.offset.saturating_add(bytes.len() as u32),
            crc: file_crc32(checksum.crc, bytes),
            ..checksum
        });
        FileStep::Idle
    }

    /// What a request for the open log reads.
    fn log_read(&mut self, header: FileAnswerHeader, offset: u32, bytes: u8) -> Option<LogRead> {
        match &self.session_of(header)?.file {
            OpenFile::Log(log) => read_of(log, offset, bytes),
            OpenFile::Parameters(_) | OpenFile::Upload(_) => None,
        }
    }
}

impl PartRequest {
    fn data(self, data: Vec<u8, MAX_FILE_BYTES>) -> FileData {
        FileData {
            header: self.header,
            burst: Burst::Continues,
            offset: self.offset,
            data,
        }
    }

    fn failed(self, error: FileError) -> FileAnswer {
        FileAnswer {
            header: self.header,
            burst: Burst::Continues,
            offset: self.offset,
            outcome: FileOutcome::Failed(error),
        }
    }
}

impl Checksum {
    fn next_read(&self) -> Option<LogRead> {
        read_of(&self.file, self.offset, MAX_FILE_BYTES as u8)
    }

    fn answer(&self, outcome: FileOutcome) -> FileAnswer {
        FileAnswer {
            header: self.header,
            burst: Burst::Continues,
            offset: 0,
            outcome,
        }
    }
}

fn done() -> Handled {
    (Some(FileOutcome::Done), FileEvent::Served)
}

fn number_is(number: u32) -> Handled {
    (Some(FileOutcome::Number(number)), FileEvent::Served)
}

fn failed(error: FileError) -> Handled {
    (Some(FileOutcome::Failed(error)), FileEvent::Served)
}

fn refused_armed() -> Handled {
    (
        Some(FileOutcome::Failed(FileError::Fail)),
        FileEvent::RefusedArmed,
    )
}

/// Ends a file of parameters.
fn end_of(upload: &Upload, parameters: &mut Parameters) -> Handled {
    if !upload.is_complete() {
        return failed(FileError::Fail);
    }
    upload.set_system_id(parameters);
    let event = match upload.not_set() {
        Some(not_set) => FileEvent::ParametersNotSet(not_set.clone()),
        None => FileEvent::ParametersSet,
    };
    (Some(FileOutcome::Done), event)
}

/// The path that a request names: its data, up to a zero.
fn path_of(request: &FileTransfer<'_>) -> Result<Path, FileError> {
    if request.size == 0 {
        return Err(FileError::InvalidDataSize);
    }
    let mut path: Vec<u8, MAX_PATH_BYTES> = Vec::new();
    for byte in request.data().take_while(|byte| *byte != 0) {
        path.push(byte).map_err(|_| FileError::FileNotFound)?;
    }
    let path = str::from_utf8(&path).ok().and_then(Path::parse);
    path.ok_or(FileError::FileNotFound)
}

fn log_of(number: u16, state: &SystemState<'_>) -> Option<LogFile> {
    state.logs.iter().copied().find(|log| log.number == number)
}

/// Up to `bytes` bytes from `offset` on; `None` at the end.
fn read_of(log: &LogFile, offset: u32, bytes: u8) -> Option<LogRead> {
    let rest = log.bytes.saturating_sub(offset).min(u32::from(bytes));
    (rest > 0).then_some(LogRead {
        number: log.number,
        offset,
        bytes: rest as u8,
    })
}

fn bytes_or_end(bytes: Vec<u8, MAX_FILE_BYTES>) -> Content {
    if bytes.is_empty() {
        Content::Error(FileError::EndOfFile)
    } else {
        Content::Bytes(bytes)
    }
}

/// What was read, unless that is nothing.
fn copied(bytes: &[u8]) -> Option<Vec<u8, MAX_FILE_BYTES>> {
    Vec::from_slice(bytes).ok().filter(|bytes| !bytes.is_empty())
}
