//! Content of an answer, piece by piece.

use super::answer::{Answer, LogPart, list_entry};
use super::request::Method;
use crate::recorder::LogSource;
use crate::system::LogReader;
use crate::tasks::{Shared, read_file};
use crate::vehicle::{ArmState, Vehicle};

/// The part of an answer behind its head that is still to be sent.
pub enum Content {
    Bytes(&'static [u8]),
    /// The list of logs as JSON, from this entry on. Its length is not announced, since logs grow, come and go meanwhile: the
    /// closing bracket shows that it is complete, and HTTP 1.0 knows no chunks.
    LogList(usize),
    Log(LogPart),
}

impl Content {
    /// The content of `answer` to a request with this method.
    pub fn of(answer: &Answer, method: Method) -> Self {
        match (answer, method) {
            (Answer::Refused(refusal), _) => Self::Bytes(refusal.reason.as_bytes()),
            (Answer::File(file), Method::Get) => Self::Bytes(file.content),
            (Answer::LogList, Method::Get) => Self::LogList(0),
            (Answer::Log(part), Method::Get) => Self::Log(*part),
            (Answer::NotModified(_) | Answer::WebSocket(_), _) | (_, Method::Head) => Self::Bytes(&[]),
        }
    }

    /// Writes the next piece for `reader` into `buffer` and returns its length, 0 at the end. A log ends early when the rover was
    /// armed, or the log is erased: a browser that has received less than announced asks for the rest.
    pub fn next_piece(
        &mut self,
        buffer: &mut [u8],
        reader: LogReader,
        logs: &dyn LogSource,
        shared: &Shared,
    ) -> usize {
        match self {
            Self::Bytes(rest) => {
                let (piece, after) = rest.split_at_checked(buffer.len()).unwrap_or((rest, &[]));
                *rest = after;
                copy(piece, buffer)
            }
            Self::LogList(index) => match shared.with(|autopilot| list_entry(*index, autopilot)) {
                Some(entry) => {
                    *index += 1;
                    copy(entry.as_bytes(), buffer)
                }
                None => {
                    let end: &[u8] = if *index == 0 { b"[\n]\n" } else { b"\n]\n" };
                    *self = Self::Bytes(&[]);
                    copy(end, buffer)
                }
            },
            Self::Log(part) => {
                let ends = |vehicle: &Vehicle| {
                    vehicle.arm_state() == ArmState::Armed || vehicle.armings() != part.armings
                };
                if shared.with(|autopilot| ends(autopilot.vehicle())) {
                    return 0;
                }
                let bytes = buffer.len().min(part.end.saturating_sub(part.first) as usize);
                if bytes == 0 {
                    shared.with(|autopilot| autopilot.log_download_ended(reader));
                    return 0;
                }
                let wanted = buffer.get_mut(..bytes).unwrap_or_default();
                let filled = read_file(part.file.number, part.first, wanted, reader, logs, shared);
                part.first = part.first.saturating_add(filled as u32);
                filled
            }
        }
    }
}

/// Writes `piece` into `buffer`, where it fits, and returns its length.
fn copy(piece: &[u8], buffer: &mut [u8]) -> usize {
    match buffer.get_mut(..piece.len()) {
        Some(start) => {
            start.copy_from_slice(piece);
            piece.len()
        }
        None => 0,
    }
}
