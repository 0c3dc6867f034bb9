//! Files on their way to a ground station, one message at a time.

use core::mem;

use super::file_transfer::FileTransfers;
use super::log_download::{LogDownload, LogRead, Refusal, Step};
use crate::mavlink::{Outgoing, Peer};
use crate::parameter::Parameters;
use crate::system::SystemState;

/// While a download runs, this many of its messages leave for each message of a stream.
const SHARE: u8 = 24;

/// The downloads of one link, and the one message of theirs that waits for the wire.
#[derive(Debug, Default)]
pub struct Downloads {
    pub logs: LogDownload,
    pub files: FileTransfers,
    /// Whether MAVLink FTP is next if the log protocol sends, too.
    are_files_next: bool,
    ready: Option<Outgoing>,
    /// Messages since the last one of a stream.
    since_stream: u8,
    /// Number of armings when it was read last.
    armings: u8,
}

impl Downloads {
    /// Arming ends every download of a log, also of a link that took nothing while the rover was armed.
    pub fn end_by_arming(&mut self, state: &SystemState<'_>) {
        let armings = mem::replace(&mut self.armings, state.armings);
        if state.is_armed() || armings != state.armings {
            self.logs.stop();
            self.files.stop_while_armed();
        }
    }

    /// Builds the next message if that needs no log to be read, else returns what to read.
    pub fn next_read(&mut self, state: &SystemState<'_>, parameters: &Parameters) -> Option<LogRead> {
        self.end_by_arming(state);
        [self.are_files_next, !self.are_files_next]
            .into_iter()
            .find_map(|is_of_files| self.step(is_of_files, state, parameters))
    }

    /// Builds the next message of MAVLink FTP, or of the log protocol, if that needs no log to be read, else returns what to read.
    fn step(
        &mut self,
        is_of_files: bool,
        state: &SystemState<'_>,
        parameters: &Parameters,
    ) -> Option<LogRead> {
        if self.ready.is_some() {
            return None;
        }
        let step = if is_of_files {
            self.files.step(state, parameters)
        } else {
            self.logs.step(state)
        };
        self.apply(step, is_of_files)
    }

    /// Has a message wait; then nothing needs to be read.
    fn apply(&mut self, step: Step, is_of_files: bool) -> Option<LogRead> {
        match step {
            Step::Idle => None,
            Step::Read(read) => Some(read),
            Step::Send(message) => {
                self.ready = Some(message);
                self.are_files_next = !is_of_files;
                None
            }
        }
    }

    /// Builds the next message from what was read of the log. What is not wanted any more is ignored.
    ///
    /// # Errors
    /// The log protocol, which has no error of its own, has broken off its download.
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) -> Result<(), Refusal> {
        if self.ready.is_some() {
            return Ok(());
        }
        if let Some(message) = self.logs.supply(read, bytes) {
            self.apply(Step::Send(Outgoing::Message(message?)), false);
        } else {
            let step = self.files.supply(read, bytes);
            self.apply(step, true);
        }
        Ok(())
    }

    /// LOG_ERASE on the link of this number.
    ///
    /// # Errors
    /// The rover is armed, or another reader has taken a piece of a log in the last ten seconds.
    pub fn erase_logs(&mut self, from: Peer, link: u16, state: &SystemState<'_>) -> Result<(), Refusal> {
        if self.files.is_log_read_by_another(from, state.now) {
            return Err(Refusal::InUse);
        }
        self.logs.erase(from, link, state)
    }

    /// Whether something is being sent.
    pub fn is_running(&self) -> bool {
        self.ready.is_some() || self.logs.is_running() || self.files.is_running()
    }

    /// Whether it is their turn when both a download and a stream could send.
    pub fn are_next(&self) -> bool {
        self.since_stream < SHARE
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
