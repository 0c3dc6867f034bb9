//! Answers to requests.

use core::fmt;

use heapless::String;

use super::files::{File, PAGE, PARAMETERS};
use super::head::{HeadWriter, Refusal, Status, refusal};
use super::request::{Request, Sender, TAG_BYTES, Tag, Target};
use crate::autopilot::Autopilot;
use crate::mavlink::LinkKind;
use crate::memory::identity::BoardId;
use crate::numbers::text;
use crate::recorder::LogFile;
use crate::time::{Day, Utc};
use crate::vehicle::ArmState;

/// An entry of the list of logs: the longest has 117 bytes.
pub type Entry = String<120>;

/// A log's name: the longest has 46 bytes.
type LogName = String<48>;

/// Body of an answer.
#[derive(Clone, Debug)]
pub enum Answer {
    Refused(Refusal),
    /// The sender has this file already.
    NotModified(File),
    File(File),
    LogList,
    Log(LogPart),
    /// The connection becomes a WebSocket; has the key that accepts it.
    WebSocket([u8; 28]),
}

/// A part of a log, or the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogPart {
    pub file: LogFile,
    /// Offset of the first byte.
    pub first: u32,
    /// Offset behind the last byte.
    pub end: u32,
    /// Whether the whole was asked for.
    pub status: Status,
    /// Number of armings before it was requested.
    pub armings: u8,
    /// The board that has recorded it, if it is known.
    pub board_id: Option<BoardId>,
}

/// The answer to a request.
pub fn answer(request: &Request, autopilot: &Autopilot) -> Answer {
    match request.target {
        Target::Page => file(PAGE, request),
        Target::Parameters => file(PARAMETERS, request),
        Target::WebSocket(key) => Answer::WebSocket(key),
        Target::LogList => match check_reader(request, autopilot) {
            Ok(()) => Answer::LogList,
            Err(refusal) => Answer::Refused(refusal),
        },
        Target::Log(number) => match log(number, request, autopilot) {
            Ok(part) => Answer::Log(part),
            Err(refusal) => Answer::Refused(refusal),
        },
    }
}

fn file(file: File, request: &Request) -> Answer {
    match &request.has {
        Some(tag) if *tag == text::<TAG_BYTES>(format_args!("{}", file.tag)) => Answer::NotModified(file),
        _ => Answer::File(file),
    }
}

/// Whether the sender may know of logs: as on each Wi-Fi link, and foreign pages never.
fn check_reader(request: &Request, autopilot: &Autopilot) -> Result<(), Refusal> {
    if request.sender == Sender::Foreign {
        return Err(refusal(Status::Forbidden, "Only the rover's own page gets logs."));
    }
    if !autopilot.permits_unsigned_reads(LinkKind::Wifi) {
        return Err(refusal(
            Status::Forbidden,
            "A key is set: logs are downloaded by signed MAVLink.",
        ));
    }
    Ok(())
}

fn log(number: u16, request: &Request, autopilot: &Autopilot) -> Result<LogPart, Refusal> {
    check_reader(request, autopilot)?;
    if autopilot.vehicle().arm_state() == ArmState::Armed {
        return Err(refusal(Status::Conflict, "Not while armed: disarm first."));
    }
    let file = autopilot
        .logs()
        .iter()
        .copied()
        .find(|file| file.number == number);
    let file = file.ok_or(refusal(Status::NotFound, "There is no such log."))?;
    let whole = LogPart {
        file,
        first: 0,
        end: file.bytes,
        status: Status::Ok,
        armings: autopilot.vehicle().armings(),
        board_id: autopilot.identity().board_id,
    };
    let is_of_this_file = match &request.has {
        Some(tag) => *tag == whole.tag(),
        None => true,
    };
    match request.range {
        Some(range) if is_of_this_file => {
            let part = range.within(file.bytes);
            let (first, end) =
                part.ok_or(refusal(Status::RangeNotSatisfiable, "The log has no such bytes."))?;
            Ok(LogPart {
                first,
                end,
                status: Status::PartialContent,
                ..whole
            })
        }
        _ => Ok(whole),
    }
}

impl LogPart {
    /// Identity of the file: one that grows is another one.
    fn tag(&self) -> Tag {
        text(format_args!("\"{}-{}\"", self.file.number, self.file.bytes))
    }
}

/// A log's name, which differs from those of other rovers. The day is that of UTC, if it is known.
fn log_name(file: &LogFile, board_id: Option<BoardId>) -> LogName {
    let board = fmt::from_fn(|f| match board_id {
        Some(id) => write!(f, "{}-", id.serial_number()),
        None => Ok(()),
    });
    let day = fmt::from_fn(|f| match file.began_utc_s {
        Some(began_utc_s) => write!(f, "{}-", Day::of(Utc::from_seconds(began_utc_s.get()))),
        None => Ok(()),
    });
    // The longest fits.
    text(format_args!("rover-{board}{day}{:08}.BIN", file.number))
}

/// The entry of the list of logs with this index, from the oldest one on, behind what separates it from the one before.
pub fn list_entry(index: usize, autopilot: &Autopilot) -> Option<Entry> {
    let separator = if index == 0 { "[" } else { "," };
    let described = description(autopilot.logs().get(index)?, autopilot.identity().board_id);
    Some(text(format_args!("{separator}\n{described}")))
}

/// A log as JSON.
pub fn description(file: &LogFile, board_id: Option<BoardId>) -> Entry {
    let LogFile { number, bytes, .. } = file;
    let time_utc = match file.began_utc_s {
        Some(began_utc_s) => text::<10>(format_args!("{began_utc_s}")),
        None => text(format_args!("null")),
    };
    let name = log_name(file, board_id);
    text(format_args!(
        "{{\"number\":{number},\"bytes\":{bytes},\"time_utc\":{time_utc},\"name\":\"{name}\"}}"
    ))
}

impl Answer {
    /// Writes the head into `buffer`.
    pub fn head<'a>(&self, buffer: &'a mut [u8]) -> &'a [u8] {
        match self {
            Self::Refused(refusal) => refused_head(refusal, buffer),
            Self::NotModified(file) => HeadWriter::new(buffer, Status::NotModified)
                .header("ETag", file.tag)
                .end(),
            Self::File(file) => HeadWriter::new(buffer, Status::Ok)
                .header("Content-Type", file.kind)
                .header("Content-Length", file.content.len())
                .header("Content-Encoding", "gzip")
                .header("ETag", file.tag)
                .end(),
            Self::LogList => HeadWriter::new(buffer, Status::Ok)
                .header("Content-Type", "application/json")
                .end(),
            Self::Log(part) => log_head(part, buffer),
            Self::WebSocket(key) => HeadWriter::new(buffer, Status::SwitchingProtocols)
                .header("Upgrade", "websocket")
                .header("Connection", "Upgrade")
                .header(
                    "Sec-WebSocket-Accept",
                    core::str::from_utf8(key).unwrap_or_default(),
                )
                .end(),
        }
    }
}

fn refused_head<'a>(refusal: &Refusal, buffer: &'a mut [u8]) -> &'a [u8] {
    let head = HeadWriter::new(buffer, refusal.status)
        .header("Content-Type", "text/plain; charset=utf-8")
        .header("Content-Length", refusal.reason.len());
    match refusal.status {
        Status::MethodNotAllowed => head.header("Allow", "GET, HEAD").end(),
        Status::ServiceUnavailable => head.header("Retry-After", 1).end(),
        _ => head.end(),
    }
}

fn log_head<'a>(part: &LogPart, buffer: &'a mut [u8]) -> &'a [u8] {
    let LogPart { file, first, end, .. } = *part;
    let name = log_name(&file, part.board_id);
    let head = HeadWriter::new(buffer, part.status)
        .header("Content-Type", "application/octet-stream")
        .header("Content-Length", end.saturating_sub(first))
        .header(
            "Content-Disposition",
            format_args!("attachment; filename=\"{name}\""),
        )
        .header("Accept-Ranges", "bytes")
        .header("ETag", part.tag());
    if part.status == Status::Ok {
        return head.end();
    }
    let last = end.saturating_sub(1);
    head.header(
        "Content-Range",
        format_args!("bytes {first}-{last}/{}", file.bytes),
    )
    .end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::num::NonZeroU32;

    #[test]
    fn a_log_is_described_with_its_date_if_that_is_known() {
        let undated = LogFile {
            number: 7,
            bytes: 1_000,
            began_utc_s: None,
        };
        assert_eq!(
            description(&undated, None),
            r#"{"number":7,"bytes":1000,"time_utc":null,"name":"rover-00000007.BIN"}"#
        );
        let longest = LogFile {
            number: u16::MAX,
            bytes: u32::MAX,
            began_utc_s: NonZeroU32::new(u32::MAX),
        };
        assert_eq!(
            description(&longest, Some(BoardId([0xe6; 8]))),
            "{\"number\":65535,\"bytes\":4294967295,\"time_utc\":4294967295,\
             \"name\":\"rover-E6E6E6E6E6E6E6E6-2106-02-07-00065535.BIN\"}"
        );
    }
}
