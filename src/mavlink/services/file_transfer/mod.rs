//! MAVLink FTP: the log files and the descriptions of the parameters to read, and the packed parameters (`@PARAM/param.pck`) to read and
//! to write.
//!
//! One session is open on a link. It ends by request, when the rover is armed unless it reads descriptions, when its ground station opens
//! another file, and when another station opens one after it has been silent. One that a signed request has opened is not ended by
//! unsigned ones before that, unless its link accepts every command of theirs. A new `SYSID_THISMAV` takes effect when the session of its
//! file ends by request, since all requests of a session are addressed to the same system id. A request that comes again is served again, which has the
//! same result; only what is being worked on is not begun a second time.

mod directory;
mod packed;
mod parameter_file;
mod reading;
mod request;
mod session;
mod upload;

use directory::{Listed, Path};
use heapless::Deque;
use parameter_file::ParameterFile;
use reading::{BurstRead, Checksum, Job, PartOf, PartRequest};
pub(in crate::mavlink) use request::writes;
use request::{Operation, ends_session, path_of};
use session::{Bytes, OpenFile, Session};
use upload::{BlockError, NotSet, Upload};

use super::Context;
use super::log_download::{LogRead, Refusal, Step};
use crate::announce::{Announce, Severity};
use crate::mavlink::event::Event;
use crate::mavlink::messages::{Burst, FileAnswer, FileAnswerHeader, FileError, FileOutcome, MAX_FILE_BYTES};
use crate::mavlink::rates::Rates;
use crate::mavlink::requests::FileTransfer;
use crate::mavlink::signing::{Authenticity, Effect};
use crate::mavlink::{Message, Peer};
use crate::parameter::{ParameterTrouble, Parameters};
use crate::recorder::LogFile;
use crate::system::SystemState;
use crate::time::Instant;

/// Requests for a part of a file or list that can wait. Ground stations send a few ahead.
const MAX_WAITING: usize = 8;

/// A request that was taken.
struct Handled {
    /// Its answer, unless that follows.
    outcome: Option<FileOutcome>,
    /// The target.
    ///
    /// # Errors
    /// A log is refused, which a text explains.
    event: Result<Event, Refusal>,
    /// Parameters that a file has not set.
    not_set: Option<NotSet>,
    /// A file that did not come whole, and that a whole one has not ended.
    half_loaded: Option<ParameterTrouble>,
}

impl From<Option<FileOutcome>> for Handled {
    fn from(outcome: Option<FileOutcome>) -> Self {
        Self {
            outcome,
            event: Ok(Event::Answered),
            not_set: None,
            half_loaded: None,
        }
    }
}

/// It has been done.
fn done() -> Handled {
    Some(FileOutcome::Done).into()
}

/// Its answer follows by [`FileTransfers::step`].
fn begun() -> Handled {
    None.into()
}

/// The session of a link, and the requests that are being served.
#[derive(Debug, Default)]
pub(in crate::mavlink) struct FileTransfers {
    session: Option<Session>,
    waiting: Deque<PartRequest, MAX_WAITING>,
    burst: Option<BurstRead>,
    checksum: Option<Checksum>,
    last_end: Option<(FileAnswerHeader, FileOutcome)>,
}

impl FileTransfers {
    /// Takes a request, and answers it unless that follows by [`Self::step`].
    ///
    /// # Errors
    /// A log is refused.
    pub fn handle(
        &mut self,
        request: &FileTransfer<'_>,
        from: Peer,
        context: &mut Context<'_>,
    ) -> Result<Event, Refusal> {
        /// From here on opcodes are those of answers.
        const FIRST_ANSWER: u8 = 128;
        if request.opcode >= FIRST_ANSWER {
            return Ok(Event::Answered);
        }
        let header = FileAnswerHeader {
            to: from,
            sender_system: context.changeable.parameters.system_id(),
            sequence: request.sequence.wrapping_add(1),
            session: request.session,
            request_opcode: request.opcode,
        };
        let may_change = context.permits(Effect::Changes);
        let result = self.serve(request, header, may_change, context);
        if context.authenticity == Authenticity::Proven
            && let Some(session) = self.session_of(header)
        {
            session.is_signed = true;
        }
        let handled = result.unwrap_or_else(|error| Some(FileOutcome::Failed(error)).into());
        let answer = handled.outcome.map(|outcome| FileAnswer {
            header,
            burst: Burst::Continues,
            offset: request.offset,
            outcome,
        });
        context.outbox.answer_any(answer.map(Message::FileAnswer));
        if let Some(not_set) = handled.not_set {
            context.outbox.say(Severity::Warning, &not_set.text());
        }
        if let Some(trouble) = handled.half_loaded {
            context.outbox.say(trouble.severity(), &trouble.text());
        }
        handled.event
    }

    // In its only caller it would leave no room to inline what it calls.
    #[inline(never)]
    fn serve(
        &mut self,
        request: &FileTransfer<'_>,
        header: FileAnswerHeader,
        may_change: bool,
        context: &mut Context<'_>,
    ) -> Result<Handled, FileError> {
        let (state, parameters) = (context.state, &mut *context.changeable.parameters);
        let protected = self
            .session
            .as_ref()
            .filter(|session| session.is_signed && !may_change);
        if let Some(session) = protected {
            if ends_session(request.opcode) && session.is_in_use(state.now) {
                return Err(FileError::NoSessionsAvailable);
            }
        } else if let Some(session) = self.session_of(header) {
            session.active_at = state.now;
        }
        if usize::from(request.size) > MAX_FILE_BYTES {
            return Err(FileError::InvalidDataSize);
        }
        match Operation::from_opcode(request.opcode).ok_or(FileError::UnknownCommand)? {
            Operation::None => Ok(done()),
            Operation::TerminateSession => Ok(self.terminate(header, parameters)),
            Operation::ResetSessions => Ok(self.reset(header.to, parameters)),
            Operation::ListDirectory(listed) => self.list(header, request, listed),
            Operation::OpenForReading => self.open(header, request, state, parameters),
            Operation::Read => self.read(header, request),
            Operation::OpenForWriting => self.open_upload(header, request, state),
            Operation::Write => self.write(header, request, parameters, context.rates),
            Operation::Checksum => self.start_checksum(header, request, state),
            Operation::BurstRead => self.start_burst(header, request, state.now),
            Operation::Change => Err(FileError::FileProtected),
        }
    }

    /// The session that a request belongs to, if it is open.
    fn session_of(&mut self, header: FileAnswerHeader) -> Option<&mut Session> {
        self.session.as_mut().filter(|session| session.has(header))
    }

    /// Closes the session. Whether all of a file of parameters came is the answer, also to the same request again. There is
    /// nothing wrong with a session that is closed.
    fn terminate(&mut self, header: FileAnswerHeader, parameters: &mut Parameters) -> Handled {
        if let Some((last, outcome)) = self.last_end
            && last == header
        {
            return Some(outcome).into();
        }
        let handled = match self.session_of(header) {
            Some(_) => self.close(parameters),
            None => done(),
        };
        self.last_end = handled.outcome.map(|outcome| (header, outcome));
        handled
    }

    /// Closes the session if it is this station's.
    fn reset(&mut self, from: Peer, parameters: &mut Parameters) -> Handled {
        let is_own = |session: &Session| session.station == from;
        if !self.session.as_ref().is_some_and(is_own) {
            return done();
        }
        Handled {
            outcome: Some(FileOutcome::Done),
            ..self.close(parameters)
        }
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

    /// Closes the session of a file that is not read while armed. Descriptions are: nothing has to be fetched for them.
    pub fn stop_while_armed(&mut self) {
        self.checksum = None;
        let is_description = |session: &Session| matches!(session.file, OpenFile::Description(_));
        if !self.session.as_ref().is_some_and(is_description) {
            self.stop();
        }
    }

    /// Whether another station reads a log, or has a moment ago.
    pub fn is_log_read_by_another(&self, from: Peer, now: Instant) -> bool {
        let is_log = |session: &Session| matches!(session.file, OpenFile::Log(_));
        self.session.as_ref().is_some_and(is_log) && self.check_free(from, now).is_err()
    }

    fn list(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        listed: Listed,
    ) -> Result<Handled, FileError> {
        match path_of(request)? {
            Path::Directory(directory) => {
                Ok(self.wait(header, request.offset, PartOf::Directory(directory, listed)))
            }
            Path::Log(_) | Path::Parameters(_) | Path::Description(_) => Err(FileError::FileNotFound),
        }
    }

    /// Whether the station may open a file: there is no session, it is its own, or its station has been silent.
    fn check_free(&self, from: Peer, now: Instant) -> Result<(), FileError> {
        let is_in_use = |session: &Session| session.station != from && session.is_in_use(now);
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
            is_signed: false,
            active_at: now,
        });
    }

    fn open(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        state: &SystemState<'_>,
        parameters: &Parameters,
    ) -> Result<Handled, FileError> {
        let path = path_of(request)?;
        self.check_free(header.to, state.now)?;
        match path {
            Path::Log(_) if state.is_armed() => Ok(refused_armed()),
            Path::Log(number) => {
                let log = log_of(number, state)?;
                self.begin(header, OpenFile::Log(log), state.now);
                Ok(Some(FileOutcome::Number(log.bytes)).into())
            }
            // With this error QGroundControl reads the parameters one by one at once; with others it waits for 10 s first.
            Path::Parameters(_) if state.is_armed() => Err(FileError::FileNotFound),
            Path::Parameters(selection) => {
                let file = ParameterFile::open(selection, parameters).ok_or(FileError::Fail)?;
                self.begin(header, OpenFile::Parameters(file), state.now);
                Ok(Handled {
                    event: Ok(Event::ListRequested),
                    ..Some(FileOutcome::Number(file.bytes(parameters))).into()
                })
            }
            Path::Description(file) => {
                self.begin(header, OpenFile::Description(file), state.now);
                Ok(Some(FileOutcome::Number(file.content().len() as u32)).into())
            }
            Path::Directory(_) => Err(FileError::FileNotFound),
        }
    }

    fn open_upload(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        state: &SystemState<'_>,
    ) -> Result<Handled, FileError> {
        let path = path_of(request).map_err(|error| match error {
            FileError::FileNotFound => FileError::FileProtected,
            other => other,
        })?;
        self.check_free(header.to, state.now)?;
        match path {
            Path::Parameters(_) if state.is_armed() => Err(FileError::Fail),
            Path::Parameters(_) => {
                self.begin(header, OpenFile::Upload(Upload::default()), state.now);
                Ok(done())
            }
            Path::Directory(_) | Path::Log(_) | Path::Description(_) => Err(FileError::FileProtected),
        }
    }

    /// A block that comes too early is not answered, as if it were lost: ground stations give up at a refusal, and send again
    /// what is not answered.
    fn write(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        parameters: &mut Parameters,
        rates: &mut Rates,
    ) -> Result<Handled, FileError> {
        let session = self.session_of(header).ok_or(FileError::InvalidSession)?;
        let OpenFile::Upload(upload) = &mut session.file else {
            return Err(FileError::FileProtected);
        };
        let mut event = Event::Answered;
        let written = upload.write(request.offset, request.data(), parameters, |id| {
            event = Event::ParametersSet;
            rates.parameter_set(id);
        });
        let outcome = match written {
            Ok(()) => Some(FileOutcome::Done),
            Err(BlockError::TooEarly) => None,
            Err(BlockError::BadFormat) => Some(FileOutcome::Failed(FileError::Fail)),
        };
        Ok(Handled {
            event: Ok(event),
            ..outcome.into()
        })
    }

    /// Whether bytes of the open file can be requested.
    fn check_readable(&mut self, header: FileAnswerHeader) -> Result<(), FileError> {
        match self.session_of(header).ok_or(FileError::InvalidSession)?.file {
            OpenFile::Upload(_) => Err(FileError::Fail),
            OpenFile::Log(_) | OpenFile::Parameters(_) | OpenFile::Description(_) => Ok(()),
        }
    }

    fn read(&mut self, header: FileAnswerHeader, request: &FileTransfer<'_>) -> Result<Handled, FileError> {
        if request.size == 0 {
            return Err(FileError::InvalidDataSize);
        }
        self.check_readable(header)?;
        Ok(self.wait(header, request.offset, PartOf::File { bytes: request.size }))
    }

    /// Has a request wait for its turn. One for which there is no room is not answered, and comes again.
    fn wait(&mut self, header: FileAnswerHeader, offset: u32, of: PartOf) -> Handled {
        let part = PartRequest { header, offset, of };
        if !self.waiting.iter().any(|waiting| *waiting == part) {
            let _ = self.waiting.push_back(part);
        }
        begun()
    }

    fn start_burst(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        now: Instant,
    ) -> Result<Handled, FileError> {
        self.check_readable(header)?;
        if self.burst.is_none_or(|burst| burst.first != header) {
            self.burst = Some(BurstRead::new(header, request.offset, request.size, now));
        }
        Ok(begun())
    }

    fn start_checksum(
        &mut self,
        header: FileAnswerHeader,
        request: &FileTransfer<'_>,
        state: &SystemState<'_>,
    ) -> Result<Handled, FileError> {
        let Path::Log(number) = path_of(request)? else {
            // The values of parameters change, and the checksum of descriptions comes with their address. Nothing asks for either.
            return Err(FileError::Fail);
        };
        if state.is_armed() {
            return Ok(refused_armed());
        }
        let file = log_of(number, state)?;
        if self.checksum.is_none_or(|checksum| checksum.header != header) {
            self.checksum = Some(Checksum::new(header, file));
        }
        Ok(begun())
    }

    /// Whether something is being sent.
    pub fn is_running(&self) -> bool {
        !self.waiting.is_empty() || self.burst.is_some()
    }

    /// The next message: parts that were requested, then a burst, then a checksum.
    fn job(&self) -> Option<Job> {
        let part = self.waiting.front().copied().map(Job::Part);
        part.or(self.burst.map(Job::Burst))
            .or(self.checksum.map(Job::Checksum))
    }

    /// The next step. An answer counts as sent; of a read, [`Self::supply`] makes it.
    pub fn step(&mut self, state: &SystemState<'_>, parameters: &Parameters) -> Step {
        if self.waiting.is_empty() {
            self.keep_burst(state.now);
        }
        let Some(job) = self.job() else {
            return Step::Idle;
        };
        if let Some(read) = job.log_read(self.session.as_mut()) {
            return Step::Read(read);
        }
        let content = job.content(self.session.as_mut(), state, parameters);
        self.send(job, content)
    }

    /// Takes what was read of a log, and returns what follows. Bytes that are not wanted any more have no effect.
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) -> Step {
        let Some(job) = self.job() else {
            return Step::Idle;
        };
        if job.log_read(self.session.as_mut()) != Some(read) {
            return Step::Idle;
        }
        // Fewer are not the end of the file: it is gone, or can't be read.
        let bytes = bytes.get(..usize::from(read.bytes));
        let content = bytes.and_then(|bytes| Bytes::from_slice(bytes).ok());
        self.send(job, content.ok_or(FileError::Fail))
    }

    /// A burst that takes too long ends; its session is in use until then.
    fn keep_burst(&mut self, now: Instant) {
        let Some(burst) = &mut self.burst else { return };
        burst.limit_time(now);
        let first = burst.first;
        if let Some(session) = self.session_of(first) {
            session.active_at = now;
        }
    }

    /// The next message of `job`, which goes on behind it.
    fn send(&mut self, job: Job, content: Result<Bytes, FileError>) -> Step {
        let step;
        match job {
            Job::Part(part) => {
                self.waiting.pop_front();
                step = part.message(content);
            }
            Job::Burst(burst) => (step, self.burst) = burst.advance(content),
            Job::Checksum(checksum) => (step, self.checksum) = checksum.advance(content),
        }
        step
    }
}

fn refused_armed() -> Handled {
    Handled {
        event: Err(Refusal::Armed),
        ..Some(FileOutcome::Failed(FileError::Fail)).into()
    }
}

/// Ends a file of parameters.
fn end_of(upload: &Upload, parameters: &mut Parameters) -> Handled {
    if !upload.is_complete() {
        return Some(FileOutcome::Failed(FileError::Fail)).into();
    }
    upload.end(parameters);
    let is_half_loaded = |trouble: &ParameterTrouble| matches!(trouble, ParameterTrouble::HalfLoaded { .. });
    Handled {
        outcome: Some(FileOutcome::Done),
        event: Ok(Event::ParametersSet),
        not_set: upload.not_set().cloned(),
        half_loaded: parameters.trouble().filter(is_half_loaded),
    }
}

fn log_of(number: u16, state: &SystemState<'_>) -> Result<LogFile, FileError> {
    let log = state.logs.iter().copied().find(|log| log.number == number);
    log.ok_or(FileError::FileNotFound)
}
