//! The log protocol: LOG_REQUEST_LIST, LOG_REQUEST_DATA, LOG_REQUEST_END and LOG_ERASE.
//!
//! A file's id is its place in the list, from 1: ground stations take the ids 1 to `num_logs` for granted. A list of
//! everything (up to 65535) renumbers the files, and nothing else does: when the oldest file is dropped afterwards, the
//! others keep their ids until the next such list, and the id of the dropped one is unknown.

use core::num::NonZeroU32;

use crate::announce::RateLimit;
use crate::mavlink::dialect::{LOG_DATA_DATA, LOG_ENTRY_DATA};
use crate::mavlink::requests::{LogDataRequest, LogListRequest};
use crate::mavlink::{Message, Outgoing, Peer};
use crate::recorder::LogFile;
use crate::system::{LOG_READER_SILENCE_US, LogProtocol, SystemState};
use crate::time::Instant;

/// Bytes of the file in one LOG_DATA; a message with fewer is the last one.
const DATA_BYTES: usize = 90;

/// LOG_REQUEST_LIST: to the last one.
const TO_THE_LAST: u16 = u16::MAX;

/// LOG_ENTRY: when the log began is unknown.
const TIME_UNKNOWN: u32 = 0;

/// After this long without a request or data of a download, another ground station may begin one, in µs.
const HOLD_US: u64 = 5_000_000;

/// Minimum time between two texts about a refusal, in µs: ground stations repeat what is refused, often many at once.
const REFUSAL_INTERVAL_US: u64 = 5_000_000;

/// File numbers, which go round from the last one to 1.
const NUMBERS: u32 = u16::MAX as u32;

/// A read of a log file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct LogRead {
    /// The file's number.
    pub number: u16,
    /// The first byte's place in the file.
    pub offset: u32,
    /// Number of bytes, at least one.
    pub bytes: u8,
    /// The protocol that it is for.
    pub protocol: LogProtocol,
}

/// The next step of a download.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap, and one of it exists at a time"
)]
pub enum Step {
    /// Nothing, there is none.
    Idle,
    /// Send a message.
    Send(Outgoing),
    /// Have a log read.
    Read(LogRead),
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    Armed,
    /// Another reader is downloading.
    InUse,
    /// There is no such log.
    Gone,
    /// A log can't be read any further: it was erased meanwhile, or the flash fails.
    Unreadable,
}

impl Refusal {
    /// The answer to its sender.
    pub fn text(self) -> &'static str {
        match self {
            Self::Armed => super::DISARM_FIRST,
            Self::InUse => "Log download in use by another station",
            Self::Gone => "There is no such log: read the list again",
            Self::Unreadable => "Log can't be read: download broken off",
        }
    }
}

/// The list and the file that are being sent on one link, at most one of each.
#[derive(Debug, Default)]
pub struct LogDownload {
    /// Number of the file with id 1.
    first: Option<u16>,
    list: Option<Listing>,
    sending: Option<Sending>,
    holder: Option<Holder>,
    explanations: RateLimit<REFUSAL_INTERVAL_US>,
}

/// The id of the file `number` if the file `first` has id 1.
fn id_of(number: u16, first: u16) -> u16 {
    let ahead = (u32::from(number) + NUMBERS - u32::from(first)) % NUMBERS;
    (ahead + 1) as u16
}

/// The rest of a list.
#[derive(Clone, Copy, Debug)]
struct Listing {
    next_id: u16,
    last_id: u16,
    /// Whether an entry of it was sent: a list has one at least.
    has_begun: bool,
}

/// The rest of what was requested of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sending {
    id: u16,
    number: u16,
    offset: u32,
    end: u32,
    /// Whether a message with fewer bytes than fit has to follow: more was requested than there is. Else the file has more,
    /// or the ground station knows its length.
    says_end: bool,
}

/// The ground station that downloads.
#[derive(Clone, Copy, Debug)]
struct Holder {
    station: Peer,
    active_at: Instant,
}

impl LogDownload {
    /// LOG_REQUEST_LIST.
    ///
    /// # Errors
    /// Another station is downloading: what it downloads must not be renumbered.
    pub fn list(
        &mut self,
        request: &LogListRequest,
        from: Peer,
        state: &SystemState<'_>,
    ) -> Result<(), Refusal> {
        self.check_use(from, state.now)?;
        if request.end == TO_THE_LAST || self.first.is_none() {
            self.first = state.logs.first().map(|oldest| oldest.number);
        }
        self.list = Some(Listing {
            next_id: request.start.max(1),
            last_id: request.end,
            has_begun: false,
        });
        Ok(())
    }

    /// LOG_REQUEST_DATA: replaces what is being sent.
    ///
    /// # Errors
    /// The rover is armed, another station is downloading, or the file is gone.
    pub fn request_data(
        &mut self,
        request: &LogDataRequest,
        from: Peer,
        state: &SystemState<'_>,
    ) -> Result<(), Refusal> {
        if state.is_armed() {
            return Err(Refusal::Armed);
        }
        self.check_use(from, state.now)?;
        self.stop();
        let oldest = state.logs.first().map(|oldest| oldest.number);
        self.first = self.first.or(oldest);
        let file = self.first.and_then(|first| {
            let mut files = state.logs.iter();
            files
                .find(|file| id_of(file.number, first) == request.id)
                .copied()
        });
        let LogFile { number, bytes, .. } = file.ok_or(Refusal::Gone)?;
        self.holder = Some(Holder {
            station: from,
            active_at: state.now,
        });
        let requested_end = request.offset.saturating_add(request.bytes);
        self.sending = Some(Sending {
            id: request.id,
            number,
            offset: request.offset,
            end: requested_end.min(bytes),
            says_end: requested_end > bytes,
        });
        Ok(())
    }

    /// LOG_REQUEST_END. That of another station has no effect.
    pub fn end(&mut self, from: Peer) {
        if self.holder.is_some_and(|holder| holder.station == from) {
            self.stop();
        }
    }

    /// LOG_ERASE on the link of this number: there is nothing left to download.
    ///
    /// # Errors
    /// The rover is armed, or another station has downloaded by the log protocol on this link, or any on another one, in the last
    /// ten seconds.
    pub fn erase(&mut self, from: Peer, link: u16, state: &SystemState<'_>) -> Result<(), Refusal> {
        if state.is_armed() {
            return Err(Refusal::Armed);
        }
        let reads = |holder: Holder| {
            holder.station != from && state.now.us_since(holder.active_at) < LOG_READER_SILENCE_US
        };
        if self.holder.is_some_and(reads) || state.log_readers.is_read_for_another(link, state.now) {
            return Err(Refusal::InUse);
        }
        self.stop();
        self.list = None;
        self.first = None;
        Ok(())
    }

    /// Ends the download, and lets other stations begin one.
    pub fn stop(&mut self) {
        self.sending = None;
        self.holder = None;
    }

    /// Whether something is being sent.
    pub fn is_running(&self) -> bool {
        self.list.is_some() || self.sending.is_some()
    }

    // Inlined, it would be repeated for each request.
    #[inline(never)]
    fn check_use(&self, from: Peer, now: Instant) -> Result<(), Refusal> {
        let is_held = |holder: Holder| {
            holder.station != from && (self.sending.is_some() || now.us_since(holder.active_at) < HOLD_US)
        };
        if self.holder.is_some_and(is_held) {
            return Err(Refusal::InUse);
        }
        Ok(())
    }

    /// Whether the text about a refusal may be sent at `now`; then it counts as sent.
    pub fn may_explain(&mut self, now: Instant) -> bool {
        self.explanations.take(now)
    }

    /// The next step. A message counts as sent; of a read, [`Self::supply`] makes the message.
    pub fn step(&mut self, state: &SystemState<'_>) -> Step {
        if let Some(entry) = self.next_entry(state.logs) {
            return Step::Send(Outgoing::Message(Message::LogEntry(entry)));
        }
        let Some(sending) = self.sending else {
            return Step::Idle;
        };
        if let Some(holder) = &mut self.holder {
            holder.active_at = state.now;
        }
        if let Some(read) = sending.next_read() {
            return Step::Read(read);
        }
        self.sending = None;
        if sending.says_end {
            Step::Send(Outgoing::Message(log_data(&sending, &[])))
        } else {
            Step::Idle
        }
    }

    /// The next LOG_ENTRY of the list.
    fn next_entry(&mut self, logs: &[LogFile]) -> Option<LOG_ENTRY_DATA> {
        let listing = self.list?;
        let next = self.first.and_then(|first| {
            let entries = logs.iter().map(|file| (id_of(file.number, first), *file));
            entries
                .filter(|(id, _)| (listing.next_id..=listing.last_id).contains(id))
                .min_by_key(|(id, _)| *id)
        });
        let last_id = self.last_id(logs);
        let (id, file) = match next {
            Some((id, file)) => {
                self.list = id.checked_add(1).map(|next_id| Listing {
                    next_id,
                    has_begun: true,
                    ..listing
                });
                (id, Some(file))
            }
            None => {
                self.list = None;
                if listing.has_begun {
                    return None;
                }
                (0, None)
            }
        };
        Some(LOG_ENTRY_DATA {
            time_utc: file
                .and_then(|file| file.began_utc_s)
                .map_or(TIME_UNKNOWN, NonZeroU32::get),
            size: file.map_or(0, |file| file.bytes),
            id,
            num_logs: last_id,
            last_log_num: last_id,
        })
    }

    /// The id of the newest file; 0 if there is none.
    fn last_id(&self, logs: &[LogFile]) -> u16 {
        let newest = self.first.zip(logs.last());
        newest.map_or(0, |(first, newest)| id_of(newest.number, first))
    }

    /// The next LOG_DATA, of the bytes that were read; `None` if they are not those that come next.
    ///
    /// # Errors
    /// They are fewer than the file had: the download is broken off, since LOG_DATA with fewer would be its end.
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) -> Option<Result<Message, Refusal>> {
        let sending = self.sending.as_mut()?;
        if sending.next_read() != Some(read) {
            return None;
        }
        let Some(bytes) = bytes.get(..usize::from(read.bytes)) else {
            self.stop();
            return Some(Err(Refusal::Unreadable));
        };
        let message = log_data(sending, bytes);
        sending.offset += bytes.len() as u32;
        let is_last = bytes.len() < DATA_BYTES || (sending.offset == sending.end && !sending.says_end);
        if is_last {
            self.sending = None;
        }
        Some(Ok(message))
    }
}

impl Sending {
    fn next_read(&self) -> Option<LogRead> {
        let rest = self.end.saturating_sub(self.offset).min(DATA_BYTES as u32);
        (rest > 0).then_some(LogRead {
            number: self.number,
            offset: self.offset,
            bytes: rest as u8,
            protocol: LogProtocol::LogData,
        })
    }
}

/// LOG_DATA with these bytes, at most [`DATA_BYTES`].
fn log_data(sending: &Sending, bytes: &[u8]) -> Message {
    let mut data = [0; DATA_BYTES];
    for (to, from) in data.iter_mut().zip(bytes) {
        *to = *from;
    }
    Message::LogData(LOG_DATA_DATA {
        ofs: sending.offset,
        id: sending.id,
        count: bytes.len().min(DATA_BYTES) as u8,
        data,
    })
}

#[cfg(test)]
mod tests;
