//! Files on their way to a ground station, one message at a time.

use super::services::log_download::{LogDownload, LogRead, Step};
use super::{Message, SystemState};

/// While a download runs, so many of its messages leave for each message of a stream.
const SHARE: u8 = 24;

/// Whose turn it is when both a download and a stream could send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    Download,
    Stream,
}

/// The downloads of one link, and the one message of theirs that waits for the wire.
#[derive(Debug, Default)]
pub(super) struct Downloads {
    pub logs: LogDownload,
    ready: Option<Message>,
    /// Messages since the last one of a stream.
    since_stream: u8,
}

impl Downloads {
    /// Builds the next message if that needs no log to be read, else returns what to read. Arming ends every download.
    pub fn next_read(&mut self, state: &SystemState<'_>) -> Option<LogRead> {
        if state.is_armed() {
            self.stop();
        }
        if self.ready.is_some() {
            return None;
        }
        match self.logs.step(state) {
            Step::Idle => None,
            Step::Read(read) => Some(read),
            Step::Send(message) => {
                self.ready = Some(message);
                None
            }
        }
    }

    /// Builds the next message from what was read of the log. What is not wanted any more is ignored.
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) {
        if self.ready.is_none() {
            self.ready = self.logs.supply(read, bytes);
        }
    }

    /// Ends the downloads of files. A list of them goes on.
    fn stop(&mut self) {
        self.logs.stop();
    }

    /// Whether something is being sent.
    pub fn is_running(&self) -> bool {
        self.ready.is_some() || self.logs.is_running()
    }

    /// Whose turn it is.
    pub fn turn(&self) -> Turn {
        if self.since_stream < SHARE {
            Turn::Download
        } else {
            Turn::Stream
        }
    }

    /// A message of a stream leaves.
    pub fn stream_taken(&mut self) {
        self.since_stream = 0;
    }

    /// The message that leaves next.
    pub fn take(&mut self) -> Option<Message> {
        let message = self.ready.take()?;
        self.since_stream = self.since_stream.saturating_add(1);
        Some(message)
    }
}
