//! Files on their way to a ground station, one message at a time.

use super::file_transfer::{FileStep, FileTransfers};
use super::log_download::{LogDownload, LogRead, Step};
use crate::mavlink::{Message, Outgoing};
use crate::parameter::Parameters;
use crate::system::SystemState;

/// While a download runs, this many of its messages leave for each message of a stream.
const SHARE: u8 = 24;

/// Whose turn it is when both a download and a stream could send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mavlink) enum NextSender {
    Download,
    Stream,
}

/// The services that send files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Service {
    #[default]
    Logs,
    Files,
}

impl Service {
    fn other(self) -> Self {
        match self {
            Self::Logs => Self::Files,
            Self::Files => Self::Logs,
        }
    }
}

/// The downloads of one link, and the one message of theirs that waits for the wire.
#[derive(Debug, Default)]
pub(in crate::mavlink) struct Downloads {
    pub logs: LogDownload,
    pub files: FileTransfers,
    /// The service that is next if both send.
    next: Service,
    ready: Option<Outgoing>,
    /// Messages since the last one of a stream.
    since_stream: u8,
}

impl Downloads {
    /// Builds the next message if that needs no log to be read, else returns what to read. Arming ends every download.
    pub fn next_read(&mut self, state: &SystemState<'_>, parameters: &Parameters) -> Option<LogRead> {
        if state.is_armed() {
            self.stop();
        }
        [self.next, self.next.other()]
            .into_iter()
            .find_map(|service| self.step(service, state, parameters))
    }

    /// The same of one service. What the log protocol and FTP read is alike, so that either takes what is supplied.
    fn step(
        &mut self,
        service: Service,
        state: &SystemState<'_>,
        parameters: &Parameters,
    ) -> Option<LogRead> {
        if self.ready.is_some() {
            return None;
        }
        match service {
            Service::Logs => match self.logs.step(state) {
                Step::Idle => None,
                Step::Read(read) => Some(read),
                Step::Send(message) => self.prepare(service, Outgoing::Message(message)),
            },
            Service::Files => {
                let step = self.files.step(state, parameters);
                self.apply(step)
            }
        }
    }

    fn apply(&mut self, step: FileStep) -> Option<LogRead> {
        match step {
            FileStep::Idle => None,
            FileStep::Read(read) => Some(read),
            FileStep::Answer(answer) => {
                self.prepare(Service::Files, Outgoing::Message(Message::FileAnswer(answer)))
            }
            FileStep::Data(data) => self.prepare(Service::Files, Outgoing::FileData(data)),
        }
    }

    /// Has a message wait. Then nothing needs to be read.
    fn prepare(&mut self, service: Service, message: Outgoing) -> Option<LogRead> {
        self.ready = Some(message);
        self.next = service.other();
        None
    }

    /// Builds the next message from what was read of the log. What is not wanted any more is ignored.
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) {
        if self.ready.is_some() {
            return;
        }
        match self.logs.supply(read, bytes) {
            Some(message) => self.prepare(Service::Logs, Outgoing::Message(message)),
            None => {
                let step = self.files.supply(read, bytes);
                self.apply(step)
            }
        };
    }

    /// Ends the downloads of files. A list of them goes on.
    fn stop(&mut self) {
        self.logs.stop();
        self.files.stop();
    }

    /// Whether something is being sent.
    pub fn is_running(&self) -> bool {
        self.ready.is_some() || self.logs.is_running() || self.files.is_running()
    }

    /// Whose turn it is.
    pub fn turn(&self) -> NextSender {
        if self.since_stream < SHARE {
            NextSender::Download
        } else {
            NextSender::Stream
        }
    }

    /// A message of a stream leaves.
    pub fn stream_taken(&mut self) {
        self.since_stream = 0;
    }

    /// The message that leaves next.
    pub fn take(&mut self) -> Option<Outgoing> {
        let message = self.ready.take()?;
        self.since_stream = self.since_stream.saturating_add(1);
        Some(message)
    }
}
